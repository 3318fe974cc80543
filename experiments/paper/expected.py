"""The rows of the paper's comparison against what a prototype had led to expect.

jerkbench run -m experiment=paper seeds=20 study=paper20
python experiments/paper/expected.py results/paper20
"""

import sys
from pathlib import Path

import pandas as pd

from jerkbench.jobs.study import load_study

POSITION = "position_rmse_m"

EXPECTED = [
    # dataset, disturbance, filter, adaptation, metric, the prototype's mean over 20 seeds
    ("field_white", "none", "baseline", "none", POSITION, 0.0140),
    ("field_white", "none", "baseline_untuned", "none", POSITION, 0.030),
    ("field_white", "none", "jerk", "none", POSITION, 0.0160),
    ("field_white", "none", "jerk", "mtf", POSITION, 0.0168),
    ("field_white", "multipath_single_axis", "jerk", "none", POSITION, 0.68),
    ("field_white", "multipath_single_axis", "jerk", "scalar_r", POSITION, 0.76),
    ("field_white", "multipath_single_axis", "jerk", "sage_husa", POSITION, 0.093),
    ("field_white", "multipath_single_axis", "jerk", "mtf", POSITION, 0.026),
    ("field_white_ruts", "none", "jerk", "none", POSITION, 0.017),
    ("field_white_ruts", "none", "jerk", "mtf", POSITION, 0.039),
    ("field_white", "none", "baseline", "none", "roll_rmse_rad", 0.0009),
    ("field_white", "none", "baseline", "none", "pitch_rmse_rad", 0.0010),
    ("field_white", "none", "baseline", "none", "anees", 3.9),
    ("field_white", "none", "jerk", "none", "anees", 4.4),
    ("field_white", "none", "baseline_untuned", "none", "anees", 102.0),
]

RATIOS = [
    # what, disturbance, metric, numerator, denominator, expected
    ("naive baseline / jerk, bias of 0.08 m/s2", "imu_bias", POSITION, "baseline_untuned", "jerk", "43"),
    ("tuned baseline / jerk, nominal", "none", POSITION, "baseline", "jerk", "0.93 to 1.17"),
    ("tuned baseline / jerk, bias and outages", "imu_bias+gnss_outage", "outage_rmse_m", "baseline", "jerk", "2 to 4"),
    ("jerk / bias, nominal", "none", POSITION, "jerk", "bias", "1 (0.4 %)"),
]


def value(table: pd.DataFrame, at: tuple[str, ...], metric: str) -> float:
    """What stands there; NaN where that was not run."""
    return float(table.loc[at, metric]) if at in table.index else float("nan")


def main(folder: Path) -> None:
    """Print measured beside expected."""
    rows = load_study(folder).rows
    keys = ["dataset", "disturbance", "filter", "adaptation"]
    means = rows[rows["status"] == "ok"].groupby(keys).mean(numeric_only=True)
    spread = rows[rows["status"] == "ok"].groupby(keys).std(numeric_only=True)
    print(f"{'':<66}{'expected':>10}{'measured':>10}{'over seeds':>12}")
    for *key, metric, expected in EXPECTED:
        at = tuple(key)
        what = f"{' '.join(key)} {metric}"
        measured, varied = (value(table, at, metric) for table in (means, spread))
        print(f"{what:<66}{expected:>10.4g}{measured:>10.3g}{varied:>12.2g}")
    print()
    for what, disturbance, metric, above, below, expected in RATIOS:
        upper, lower = (value(means, ("field_white", disturbance, name, "none"), metric) for name in (above, below))
        print(f"{what:<60}{expected:>16}{upper / lower:>10.3g}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
