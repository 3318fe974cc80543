"""The paper's claims against the rows of its comparison, one by one, at defaults.

python experiments/paper/claims.py results/paper20
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.claims import CENTIMETRES_M, CLAIMED_TIMES, Claim, claim_table
from jerkbench.audit.scenarios import Scenario
from jerkbench.evaluation.statistics.intervals.student import student_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL
from jerkbench.results.study import load_study

CLAIMED = ("jerk", "mtf")
NAIVE, BASELINE = ("baseline_naive", "none"), ("baseline", "none")
ROLL_RAD, PITCH_RAD = 0.0051, 0.0076
"""The paper's errors of the tilt [rad]."""
LOST_M = 1000.0
"""What the position error of a lost run counts [m]: beyond it a run is lost."""


def logs(rows: pd.DataFrame, method: tuple[str, str], metric: str) -> pd.DataFrame:
    """Return the logarithm of a metric: a line for each scenario, a column for each seed."""
    own = rows[(rows["filter"] == method[0]) & (rows["adaptation"] == method[1])]
    values = own[metric].where((own["status"] == "ok") | (metric != "position_rmse_m"), LOST_M)
    return np.log(
        own.assign(value=values).pivot_table(index=["dataset", "disturbance"], columns="seed", values="value")
    )


def claims(rows: pd.DataFrame) -> list[Claim]:
    """Return every claim in every scenario."""
    error, naive, baseline = (logs(rows, method, "position_rmse_m") for method in (CLAIMED, NAIVE, BASELINE))
    faults = error.index.get_level_values("disturbance") != "none"
    return [
        _claim(f"roll within {ROLL_RAD:g} rad", "", logs(rows, CLAIMED, "roll_rmse_rad"), ROLL_RAD, "rad"),
        _claim(f"pitch within {PITCH_RAD:g} rad", "", logs(rows, CLAIMED, "pitch_rmse_rad"), PITCH_RAD, "rad"),
        _claim(f"more than {CLAIMED_TIMES:g} times better", "naive baseline", error - naive, 1 / CLAIMED_TIMES),
        _claim(f"more than {CLAIMED_TIMES:g} times better", "baseline", error - baseline, 1 / CLAIMED_TIMES),
        _claim("an error of centimetres (below 0.1 m)", "", error, CENTIMETRES_M, "m"),
        _claim("resilient: under a fault better", "naive baseline", (error - naive)[faults], 1.0),
        _claim("resilient: under a fault better", "baseline", (error - baseline)[faults], 1.0),
    ]


def _claim(name: str, against: str, values: pd.DataFrame, bound: float, unit: str = "") -> Claim:
    scenarios = tuple(Scenario(field, {}, fault, fault, "both", {}) for field, fault in values.index)
    return Claim(name, against or "-", unit, _intervals(values.to_numpy()), bound, scenarios)


def _intervals(d: FloatArray) -> FloatArray:
    low, high = student_intervals(d, 1 - LEVEL / len(d))
    return np.asarray(np.exp(np.column_stack([d.mean(axis=1), low, high])))


def table(folder: Path) -> str:
    """Return the claims as Markdown."""
    return claim_table(claims(load_study(folder).rows)).replace("| set |", "| against |")


if __name__ == "__main__":
    print(table(Path(sys.argv[1])))
