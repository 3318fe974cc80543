"""Methods that change the prior, with both engines, against the equations of their papers in textbook form."""

from functools import partial

import numpy as np
import pytest
import textbook

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
