"""Scores from rows whose answer is known: made by hand, no filter runs."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.suite.campaign import half_settings
from jerkbench.suite.protocol import read_suite
from jerkbench.suite.scores import ByPosition

PROTOCOL = read_suite("tiny")
SCORING = ByPosition(PROTOCOL)
FACTORS = {"plain": {"given": 2.0, "first": 1.0, "second": 1.0}, "entry": {"given": 3.0, "first": 0.5, "second": 0.8}}
"""Error of each setting over the tuned plain filter's."""


def rows(lost=()):
    rng, made = np.random.default_rng(5), []
    for number, scenario in enumerate(PROTOCOL.scenarios):
        for seed in PROTOCOL.seeds_to_test_on:
            common = 0.1 * np.exp(rng.normal(0.0, 0.3))
            for method, factors in FACTORS.items():
                for tuned_on in half_settings(dict.fromkeys(factors, ()), scenario.half):
                    away = (method, number, tuned_on) in lost
                    values = {"status": "diverged" if away else "ok", "anees": 6.0, "seconds": 0.006}
                    error = np.nan if away else common * factors[tuned_on]
                    head = {"method": method, "tuned_on": tuned_on, "scenario": number, "seed": seed}
                    made.append({**head, **values, "position_rmse_m": error})
    return pd.DataFrame(made)


def test_each_scenario_is_scored_with_what_was_tuned_on_the_other_half():
    """outliers (first) with .8 of second, wheel_slip (second) with .5 of first, none with the mean of both logs."""
    score = SCORING.score(rows())

    assert score["ratio"] == pytest.approx((0.8 * 0.5 * np.sqrt(0.4)) ** (1 / 3), rel=1e-12)
    assert score["nominal"] == pytest.approx(np.sqrt(0.4), rel=1e-12)
    assert score["worst"].endswith(", outliers")
    assert score["worst_ratio"] == pytest.approx(0.8, rel=1e-12)
    assert score["given"] == pytest.approx(3.0, rel=1e-12)
    assert score["step_ns"] == pytest.approx(0.006 / 4000 * 1e9)
    assert (score["lost"], score["anees"]) == (0.0, 6.0)


def test_a_lost_run_counts_a_hundred_times_what_the_plain_filter_has_as_it_comes():
    score = SCORING.score(rows(lost={("entry", 2, "first")}))

    assert score["worst"] == "white, wheel_slip"
    assert score["worst_ratio"] == pytest.approx(200.0, rel=1e-9)
    assert score["lost"] == pytest.approx(1 / 8)


def test_one_that_was_not_tuned_is_scored_as_it_came():
    made = rows()
    untuned = made[(made["method"] == "plain") | (made["tuned_on"] == "given")]

    score = SCORING.score(untuned)

    assert (score["ratio"], score["given"]) == (pytest.approx(3.0, rel=1e-12), pytest.approx(3.0, rel=1e-12))
