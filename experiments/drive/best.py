"""The drive's summary: each filter at its best sigma_a of the six, for each adaptation.

python experiments/drive/best.py results/drive
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.jobs.study import load_study
from jerkbench.report.table_model import number

COLUMNS = {"withhold": "position_rmse_m", "withhold+twelve_outages": "outage_rmse_m"}
METHOD = ["filter", "adaptation", "noise"]


def best(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """The lowest geometric mean over the phases, and the sigma_a that gives it; what lost a phase does not compete."""
    sound = rows.groupby(METHOD, sort=False).filter(lambda cell: (cell["status"] == "ok").all())
    logs = np.log(sound[metric]).groupby([sound[key] for key in METHOD], sort=False).mean()
    means = np.exp(logs).rename("mean").reset_index()
    chosen = means.loc[means.groupby(["filter", "adaptation"], sort=False)["mean"].idxmin()]
    sigmas = (noise.removeprefix("accel_mps2=") for noise in chosen["noise"])
    swept = [f" ({sigma})" if sigma != "default" else "" for sigma in sigmas]
    texts = [f"{number(mean)}{sigma}" for mean, sigma in zip(chosen["mean"], swept, strict=True)]
    table = chosen.assign(text=texts).pivot_table(index="filter", columns="adaptation", values="text", aggfunc="first")
    return table.reindex(index=rows["filter"].unique(), columns=rows["adaptation"].unique())


def main(folder: Path) -> None:
    """Print one table for the whole drive and one for the outages."""
    rows = load_study(folder).rows
    for disturbance, metric in COLUMNS.items():
        table = best(rows[rows["disturbance"] == disturbance], metric).fillna("-")
        print(f"\n{metric} with {disturbance}: best of six sigma_a (in parentheses, m/s2)\n")
        print("| filter | " + " | ".join(table.columns) + " |")
        print("|---" * (1 + len(table.columns)) + "|")
        for name, cells in table.iterrows():
            print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
