"""The column that says in words whether a cell's filter is as sure of itself as it may be."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.evaluation.statistics.consistency import NEAR, UNKNOWN, runs_verdict
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import FEW
from jerkbench.report.analysis.quantities import EXPECTED

if TYPE_CHECKING:
    import pandas as pd

HEADING = "NEES says"

METRIC = "anees"
CONSISTENT = EXPECTED[METRIC]


def explanation(rows: "pd.DataFrame") -> str:
    """Return how to read the column; nothing where no cell has a value to judge."""
    if METRIC not in rows or rows[METRIC].isna().all():
        return ""
    low, high = (factor * CONSISTENT for factor in NEAR)
    return (
        f"{HEADING}: overconfident or too cautious where the whole interval of the ANEES over the seeds is above or "
        f"below {CONSISTENT:g}; consistent where it holds {CONSISTENT:g} and lies within {low:g} to {high:g}; not "
        f"known where it holds more than that, of one run and of phases. Of fewer than {FEW} seeds the interval is "
        "Student's on the logarithms. Where runs were lost the others can only be overconfident or not known."
    )


def says(group: "pd.DataFrame") -> str:
    """Return the verdict on the rows of one cell; phases of one recording are no independent runs."""
    if METRIC not in group:
        return ""
    if (group["replicate"] == "phase").any():
        return UNKNOWN
    well = group["status"] == "ok"
    values = group.loc[well, METRIC].to_numpy(dtype=np.float64)
    return runs_verdict(values, CONSISTENT, lost=int((~well).sum())).word
