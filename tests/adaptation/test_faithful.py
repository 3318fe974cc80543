"""Methods that change the prior, with both engines, against the equations of their papers in textbook form."""

from functools import partial

import numpy as np
import pytest
import textbook

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.contracts import empty_memory
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.plugins import create
from plain_filter import assert_follows, run_plain
from rough import rough_timeline

ONE_SIDED = {"sides": "measurement"}
AT_UPDATE = {"start": "update"}
ALPHA = np.repeat([1.0, 0.5, 2.0], 3)
METHODS = {
    "huber": ({}, lambda: textbook.huber),
    "huber, measurement": (ONE_SIDED, lambda: partial(textbook.huber, **ONE_SIDED)),
    "maximum_correntropy": ({}, lambda: textbook.correntropy),
    "maximum_correntropy, measurement": (ONE_SIDED, lambda: partial(textbook.correntropy, **ONE_SIDED)),
    "maximum_correntropy, update": (AT_UPDATE, lambda: partial(textbook.correntropy, **AT_UPDATE)),
    "maximum_correntropy, wide": ({"bandwidth": 10.0}, lambda: partial(textbook.correntropy, sigma=10.0)),
    "ssmkf": ({}, lambda: textbook.similarity),
    "ssmkf, measurement": (ONE_SIDED, lambda: partial(textbook.similarity, **ONE_SIDED)),
    "ssmkf, sqrt": ({"function": "sqrt"}, lambda: partial(textbook.similarity, function="sqrt")),
    "ssmkf, exp": ({"function": "exp", "sigma": 10.0}, lambda: partial(textbook.similarity, function="exp")),
    "student_t": ({}, lambda: textbook.student_t),
    "student_t, measurement": (ONE_SIDED, lambda: partial(textbook.student_t, **ONE_SIDED)),
    "vbakf_pr": ({}, textbook.VariationalPriorAndNoise),
    "sif": ({}, lambda: textbook.sliding_innovation),
    "strong_tracking": ({}, textbook.StrongTracking),
    "strong_tracking, alpha": (
        {"velocity": 0.5, "other": 2.0, "forgetting": 0.8, "softening": 2.0},
        lambda: textbook.StrongTracking(ALPHA, 0.8, 2.0),
    ),
    "sage_husa_qr": ({}, textbook.SageHusaBoth),
}


@pytest.fixture(scope="module")
def timeline():
    return rough_timeline(3.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_both_engines_follow_the_textbook(timeline, method):
    parameters, correction = METHODS[method]
    rule, model = create("adaptation", {"name": method.split(",")[0], **parameters}), create("filter", {"name": "jerk"})
    states = run_plain(timeline, model, correction())

    for engine in (FilterpyEngine(), CompiledEngine()):
        assert_follows(engine.run(timeline, model, rule), states)


WALK = [
    ("huber", {}, (0.18, 0.26), (1.03, 1.12)),
    ("ssmkf", {}, (0.18, 0.26), (1.04, 1.12)),
    ("ssmkf", ONE_SIDED, (0.18, 0.26), (0.15, 0.45)),
    ("student_t", {}, (0.18, 0.26), (0.25, 0.50)),
    ("student_t", ONE_SIDED, (0.18, 0.26), (0.15, 0.35)),
    ("maximum_correntropy", {"bandwidth": 5.0}, (0.18, 0.26), (0.15, 0.25)),
    ("maximum_correntropy", {"bandwidth": 5.0, **AT_UPDATE}, (0.18, 0.26), (1.02, 1.12)),
    ("maximum_correntropy", {"bandwidth": 2.0, **ONE_SIDED, **AT_UPDATE}, (0.18, 0.26), (0.15, 0.45)),
]
"""Ratios of the RMSE to the RMSE of the Kalman filter, for a small Q and for a Q that is large compared with R."""


@pytest.mark.parametrize(("name", "parameters", "small", "large"), WALK)
def test_outliers_of_a_random_walk_are_rejected_unless_the_prior_has_less_weight(name, parameters, small, large):
    """R = 1 with 5 % outliers of 30 sigma; with Q = 10, methods that weight the prior reduce its weight."""
    for Q, (low, high) in ((0.1, small), (10.0, large)):
        ratio = walk_rmse(create("adaptation", {"name": name, **parameters}), Q) / walk_rmse(NoAdaptation(), Q)
        assert low <= ratio <= high


def walk_rmse(rule, Q, steps=800):
    rng = np.random.default_rng(5)
    truth = np.cumsum(rng.normal(0.0, np.sqrt(Q), steps))
    z = truth + rng.normal(size=steps) + 30.0 * rng.choice([-1.0, 0.0, 1.0], steps, p=[0.025, 0.95, 0.025])
    x, P, row, memory, errors = np.zeros(1), np.eye(1), np.array([0]), empty_memory(rule, 1), []
    for k in range(steps):
        P, y, R = P + Q, z[k : k + 1] - x, np.eye(1)
        if hasattr(rule, "adapt_prior"):
            P = rule.adapt_prior(x, P, np.eye(1), np.full((1, 1), Q), y, R, row, memory)
        R = rule.adapt(y, P, R, row, memory)
        K = rule.adapt_gain(x, P, y, R, row, memory) if hasattr(rule, "adapt_gain") else P / (P + R)
        x, P = x + K @ y, (1.0 - K) ** 2 * P + K**2 * R
        errors.append(x[0] - truth[k])
    return np.sqrt(np.mean(np.square(errors)))
