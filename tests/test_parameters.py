"""Ranges and origins of parameters: their scales, what `show` says of them, what the conformance kit refuses."""

import math
from dataclasses import dataclass, fields
from typing import Annotated

import pytest

from jerkbench import plugins
from jerkbench.parameters import Range, origins_of, range_problems
from jerkbench.plugins.catalogue import show_text


@pytest.mark.parametrize(
    ("bounds", "middle"),
    [
        (Range(1.0, 3.0), 2.0),
        (Range(0.01, 1.0, log=True), 0.1),
        (Range(0.9, 0.999, toward_one=True), 0.99),
    ],
)
def test_the_middle_of_a_range_is_that_of_its_scale(bounds, middle):
    assert bounds.value(0.5) == pytest.approx(middle)
    assert bounds.share(middle) == pytest.approx(0.5)
    assert (bounds.value(0.0), bounds.value(1.0)) == (bounds.low, pytest.approx(bounds.high))


@pytest.mark.parametrize(
    ("bounds", "sentence"),
    [
        (Range(2.0, 2.0, source="x"), "low < high"),
        (Range(1.0, math.inf, source="x"), "both finite"),
        (Range(0.0, 1.0, log=True, source="x"), "above 0"),
        (Range(0.5, 1.0, toward_one=True, source="x"), "below 1"),
        (Range(0.5, 0.9, log=True, toward_one=True, source="x"), "two scales"),
        (Range(0.5, 0.9), "where the bounds come from"),
    ],
)
def test_a_range_without_sense_says_what_is_wrong(bounds, sentence):
    assert sentence in bounds.mistake()


def made(annotation, default):
    @dataclass(frozen=True)
    class Plugin:
        knob: annotation = default

    return Plugin


@pytest.mark.parametrize(
    ("annotation", "default", "sentence"),
    [
        (Annotated[float, Range(1.0, 2.0, source="x")], 3.0, "outside of its range 1 to 2"),
        (Annotated[float, Range(2.0, 1.0, source="x")], 1.5, "is not valid"),
        (Annotated[float | None, Range(1.0, 2.0, source="x")], None, "needs a number to start from"),
        (Annotated[int, Range(0.5, 2.0, source="x")], 1, "is an integer"),
    ],
)
def test_the_conformance_kit_refuses_a_range_that_does_not_fit(annotation, default, sentence):
    (problem,) = range_problems(made(annotation, default))

    assert sentence in problem


def test_show_prints_the_origin_of_a_default_and_its_range():
    text = show_text("adaptation", "mtf")

    assert "window: literature: the paper has mu = 1" in text
    assert "range 1 to 50, logarithmic (ours: " in text


def test_every_number_of_our_filters_and_adaptations_says_where_its_default_comes_from():
    switches = {"track_least_m", "still_window_s", "still_accel_mps2", "still_gyro_radps", "still_below_mps"}
    switches |= {"constraint_interval_s"}
    switches |= {"max_gap_s", "time_limit_s", "seed"}  # of trajectories and programs from elsewhere
    for kind in ("filter", "adaptation"):
        for name in plugins.names(kind):
            cls = plugins.get(kind, name)
            if plugins.is_own(cls):
                numbers = {field.name for field in fields(cls) if type(field.default) in (int, float)}
                assert numbers - switches <= set(origins_of(cls)), name
