"""The first screen: the claim where it is asked for, and never beside nothing shown."""

import numpy as np
import pandas as pd

from jerkbench.report.analysis.study_verdicts import study_verdicts
from jerkbench.report.page.cells import by_combination, combinations
from jerkbench.report.page.claim import NOTHING_SHOWN
from jerkbench.report.page.first_screen import first_screen

FACTORS = {"dataset": "field", "attitude": "tilt", "noise": "own", "replicate": "seed", "status": "ok", "reason": ""}


def rows(seeds, times):
    rng = np.random.default_rng(5)
    made = []
    for name, adaptation, factor in (("baseline", "none", 1.0), ("jerk", "none", 0.9), ("jerk", "mtf", 1 / times)):
        for disturbance in ("none", "bias"):
            values = factor * np.exp(0.1 * rng.standard_normal(seeds))
            head = {**FACTORS, "filter": name, "adaptation": adaptation, "disturbance": disturbance}
            made += [{**head, "seed": seed, "position_rmse_m": value} for seed, value in enumerate(values)]
    return pd.DataFrame(made)


def screen(frame, *, of_the_paper):
    cells = by_combination(combinations(frame, "position_rmse_m"))
    verdicts = study_verdicts(frame, "position_rmse_m")
    return first_screen(frame, verdicts, "position_rmse_m", cells, of_the_paper=of_the_paper)


def test_the_papers_claim_stands_in_the_papers_study_alone():
    assert screen(rows(20, 30.0), of_the_paper=False).claim is None
    claim = screen(rows(20, 30.0), of_the_paper=True).claim
    assert "it holds in 2" in claim.headlines[0]


def test_where_nothing_is_shown_the_claim_does_not_hold_either():
    shown = screen(rows(2, 12.0), of_the_paper=True)
    assert shown.answer.startswith("None of 3 methods was shown to beat another")
    assert shown.claim.headlines == [NOTHING_SHOWN]
    assert not shown.claim.cases


def test_the_leader_is_held_against_the_baseline():
    lead, _ = screen(rows(20, 30.0), of_the_paper=False).leads
    assert lead.names == ("jerk+mtf",)
    assert "times better" in lead.against
