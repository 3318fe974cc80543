"""The outage's summary: each filter without adaptation at its best sigma_a of the six for the horizontal.

python experiments/comma2k19/summary.py results/comma2k19
"""

import sys
from pathlib import Path

import pandas as pd

from jerkbench.jobs.study import load_study
from jerkbench.report.table_model import number

HORIZONTAL, UP = "outage_rmse_horizontal_m", "outage_rmse_up_m"


def best(cells: pd.DataFrame) -> str:
    """Return horizontal / up of the lowest horizontal error, and the sigma_a that gives it."""
    sound = cells[cells["status"] == "ok"]
    row = sound.loc[sound[HORIZONTAL].idxmin()]
    sigma = f" ({row['noise'].removeprefix('accel_mps2=')})" if row["noise"] != "default" else ""
    return f"{number(row[HORIZONTAL])} / {number(row[UP])}{sigma}"


def main(folder: Path) -> None:
    """Print a line for each filter and adaptation, a column for each way of using the wheel."""
    rows = load_study(folder).rows
    datasets = rows["dataset"].unique()
    print("| filter | adaptation | " + " | ".join(datasets) + " |")
    print("|---" * (2 + len(datasets)) + "|")
    for (name, adaptation), cells in rows.groupby(["filter", "adaptation"], sort=False):
        print(f"| {name} | {adaptation} | " + " | ".join(best(cells[cells["dataset"] == d]) for d in datasets) + " |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
