"""The RMSE of the inclination of each trial, with the floor, and the means over the trials.

python experiments/broad/summary.py results/broad
"""

import sys
from pathlib import Path

from jerkbench.jobs.study import load_study
from jerkbench.report.table_model import number

METRIC, FLOOR = "inclination_rmse_deg", "inclination_floor_deg"


def main(folder: Path) -> None:
    """Print a line for each trial, a column for each attitude."""
    rows = load_study(folder).rows
    table = rows.pivot_table(index="dataset", columns="attitude", values=METRIC, sort=False)
    table = table.reindex(index=rows["dataset"].unique(), columns=rows["attitude"].unique())
    table.insert(0, "floor", rows.groupby("dataset")[FLOOR].mean())
    table.loc["mean"] = table.mean()
    print("| trial | " + " | ".join(map(str, table.columns)) + " |")
    print("|---" * (1 + len(table.columns)) + "|")
    for name, values in table.iterrows():
        print(f"| {name} | " + " | ".join(map(number, values)) + " |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
