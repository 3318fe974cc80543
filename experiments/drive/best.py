"""Prints the drive's summary: each filter at its best sigma_a of the six, for each adaptation.

python experiments/drive/best.py results/drive
"""

import sys
from pathlib import Path

import pandas as pd

COLUMNS = {"withhold": "position_rmse_m", "withhold+twelve_outages": "outage_rmse_m"}


def best(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """The lowest mean over the phases and the sigma_a that gives it; a combination that diverged does not compete."""
    sound = rows.groupby(["filter", "adaptation", "noise"], sort=False).filter(
        lambda one: (one["status"] == "ok").all()
    )
    means = sound.groupby(["filter", "adaptation", "noise"], sort=False)[metric].mean().reset_index()
    chosen = means.loc[means.groupby(["filter", "adaptation"], sort=False)[metric].idxmin()]
    text = chosen[metric].map("{:.3g}".format) + " (" + chosen["noise"].str.removeprefix("accel_mps2=") + ")"
    return chosen.assign(text=text).pivot_table(
        index="filter", columns="adaptation", values="text", aggfunc="first", sort=False
    )


def main(folder: Path) -> None:
    """Print one table for the whole drive and one for the outages."""
    rows = pd.read_csv(folder / "rows.csv")
    for disturbance, metric in COLUMNS.items():
        print(f"\n{metric} with {disturbance}: best of six sigma_a (in parentheses, m/s2)\n")
        print(best(rows[rows["disturbance"] == disturbance], metric).fillna("-").to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
