"""The reviewer's question after the seeds, where a recording has phases and where it has one run."""

import pandas as pd
import pytest

from jerkbench.report.findings import findings
from jerkbench.report.review import Evidence, review
from jerkbench.report.study_verdicts import study_verdicts

PHASES = "are phases of recordings"
ONE_RUN = "are the one run of a recording in which nothing is random"


def sentences(rows, metric):
    return findings(rows, study_verdicts(rows, metric))


def rows_of(cell_rows, runs):
    rows = [*cell_rows("jerk", "none", [1.0] * runs), *cell_rows("jerk", "mtf", [2.0] * runs)]
    return pd.DataFrame([row | {"replicate": "phase"} for row in rows])


@pytest.mark.parametrize(
    ("runs", "said", "not_said"), [(1, f"2 rows {ONE_RUN}", PHASES), (4, f"8 rows {PHASES}", ONE_RUN)]
)
def test_only_what_was_withheld_has_phases(cell_rows, runs, said, not_said):
    kinds = ("dataset", "disturbance", "attitude", "filter", "adaptation", "noise")
    cell = {"labels": {"dataset": "drive"}, "spec": {kind: {"name": "x"} for kind in kinds}, "data": "", "notes": []}
    evidence = Evidence(rows_of(cell_rows, runs), [{**cell, "protocol": {}}], "position_rmse_m")
    (reason,) = [check.reason for check in review(evidence) if "enough seeds" in check.question]
    assert said in reason
    assert not_said not in reason


def test_one_run_is_no_range_over_phases(cell_rows):
    (said,) = sentences(rows_of(cell_rows, 1), "position_rmse_m")
    assert "(one run of one recording; no test)" in said
