"""The tables of the page, from the kept rows.

    python experiments/attitude/page.py [PAGE]

prints them, or writes them into a page. Most are those of `jerkbench audit attitude`; starts and navigation are added.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench import files
from jerkbench.audit.attitude.tables import TILT_TABLES, VERDICT_HEADS, plain_table, verdict_cells
from jerkbench.audit.attitude.tuned import TiltErrors, errors_of, tilt_verdicts

HERE = Path(__file__).parent
KEPT, NAVIGATION, STARTS = HERE / "errors.parquet", HERE / "navigation.parquet", HERE / "starts.parquet"
KINEMATIC = ("baseline", "jerk")


def of_navigation(errors: TiltErrors) -> str:
    """Position errors with each attitude against those with `constant`, and how much of the gap to eskf15 it closes."""
    del errors
    rows = pd.read_parquet(NAVIGATION)
    rows["loss"] = np.log(rows["position_rmse_m"].astype(float))
    mean = rows.pivot_table(index=["filter", "attitude"], columns="drive", values="loss")  # over the traces
    (inertial,) = mean.drop(index=list(KINEMATIC), level="filter").to_numpy()
    parts = []
    for model in KINEMATIC:
        own = {str(name): mean.loc[(model, name)].to_numpy()[None] for name in mean.loc[model].index}
        gap = float((own["constant"] - inertial).mean())
        gains = {name: (own["constant"] - own[name]).mean() for name in own}
        closed = {name: f"{gain / gap:.2f}" if gap > 0 else "-" for name, gain in gains.items()}
        found = tilt_verdicts(own, "constant")
        head = [f"{model} (n = {len(inertial)})", *VERDICT_HEADS, "closed"]
        parts.append(plain_table(head, [[name, *verdict_cells(of), closed[name]] for name, of in found.items()]))
        parts.append(f"eskf15 has {np.exp(-gap):.2f} times the error of {model} with `constant`.")
    return "\n\n".join(parts)


def of_starts(errors: TiltErrors) -> str:
    """The error of each alignment at the first sample."""
    del errors
    found = pd.read_parquet(STARTS).groupby("alignment", sort=False)["error_deg"]
    cells = [[str(name), f"{own.median():.2f}", f"{own.max():.2f}"] for name, own in found]
    return plain_table(["alignment", "median [deg]", "worst [deg]"], cells)


TABLES: dict[str, Callable[[TiltErrors], str]] = {**TILT_TABLES, "starts": of_starts, "navigation": of_navigation}


def filled(page: str, errors: TiltErrors) -> str:
    """Return the page with each of its tables from the rows."""
    return files.filled(page, {name: make(errors) for name, make in TABLES.items()})


def main() -> None:
    """Print the tables, or write them into the page that is named."""
    errors = errors_of(pd.read_parquet(KEPT))
    if len(sys.argv) > 1:
        page = Path(sys.argv[1])
        page.write_text(filled(page.read_text(encoding="utf-8"), errors), encoding="utf-8")
    else:
        print("\n\n".join(make(errors) for make in TABLES.values()))


if __name__ == "__main__":
    main()
