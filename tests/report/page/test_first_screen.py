"""The first screen: who leads, and nothing that was not shown."""

import numpy as np
import pandas as pd

from jerkbench.report.analysis.study_verdicts import study_verdicts
from jerkbench.report.page.cells import by_combination, combinations
from jerkbench.report.page.first_screen import first_screen

FACTORS = {
    "dataset": "field",
    "attitude": "tilt",
    "noise": "default",
    "replicate": "seed",
    "status": "ok",
    "reason": "",
}


def rows(seeds, times):
    rng = np.random.default_rng(5)
    made = []
    for name, adaptation, factor in (("baseline", "none", 1.0), ("jerk", "none", 0.9), ("jerk", "mtf", 1 / times)):
        for disturbance in ("none", "bias"):
            values = factor * np.exp(0.1 * rng.standard_normal(seeds))
            head = {**FACTORS, "filter": name, "adaptation": adaptation, "disturbance": disturbance}
            made += [{**head, "seed": seed, "position_rmse_m": value} for seed, value in enumerate(values)]
    return pd.DataFrame(made)


def screen(frame):
    cells = by_combination(combinations(frame, "position_rmse_m"))
    verdicts = study_verdicts(frame, "position_rmse_m")
    return first_screen(frame, verdicts, "position_rmse_m", cells)


def test_where_nothing_is_shown_nobody_is_said_to_lead():
    assert screen(rows(2, 12.0)).answer.startswith("None of 3 methods was shown to beat another")


def test_the_leader_is_held_against_the_baseline():
    lead, _ = screen(rows(20, 30.0)).leads
    assert lead.names == ("jerk+mtf",)
    assert "times better" in lead.against
