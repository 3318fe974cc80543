"""The compiled mixture against the NumPy mixture, for pairs of models and for adaptations."""

from functools import cache

import pytest

from engine_agreement import (
    agree_runs,
    assert_batch_agrees,
    assert_same_until_it_stops,
    with_a_negative_variance,
    with_other_last_bits,
)
from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.disturbances.noise import NoiseStep
from jerkbench.filters.common import adaptations_of_r
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.kinematic.mixture import mix_single
from jerkbench.kinematic.rules import compiled_rule
from jerkbench.timeline import build_timeline

PAIRS = [("baseline", "jerk"), ("jerk", "baseline"), ("baseline", "baseline"), ("bias", "bias")]
PAIRS += [("acceleration", "acceleration"), ("acceleration", "baseline")]


@cache
def recorded():
    recording = NoiseStep().apply(FieldWhite(duration_s=12.0).load(4), 0)
    return recording, Tilt().estimate(recording)


def compare(model, adaptation):
    timeline = build_timeline(*recorded())
    requested = model._mixture(timeline, adaptation).run()
    got = model.estimate_compiled(*recorded(), adaptation)

    @cache
    def changed(seed):
        return model._mixture(with_other_last_bits(timeline, seed), adaptation).run()

    agree_runs(timeline, got, requested, changed)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_it_agrees_with_numpy_for_each_pair(first, second):
    compare(InteractingMultipleModels(first, second), Mtf())


@pytest.mark.parametrize("name", adaptations_of_r())
def test_it_agrees_with_numpy_with_each_adaptation(name):
    compare(InteractingMultipleModels(), plugins.create("adaptation", {"name": name}))


@pytest.mark.slow
def test_sums_agree_with_the_trajectory():
    assert_batch_agrees([InteractingMultipleModels()] * 2, *recorded(), Mtf())


def test_it_diverges_at_the_same_time_as_numpy():
    timeline = with_a_negative_variance(build_timeline(*recorded()), 50)
    model = InteractingMultipleModels()
    got = mix_single(timeline, model.start(timeline), compiled_rule(Mtf()))
    requested = model._mixture(timeline, Mtf()).run()

    assert_same_until_it_stops(got, requested)
