"""The compiled mixture against the NumPy one, over pairs of models and adaptations."""

from functools import cache

import numpy as np
import pytest

from engine_agreement import (
    agree_runs,
    assert_same_sums,
    assert_same_until_it_stops,
    with_a_negative_variance,
    with_other_last_bits,
)
from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.disturbances.noise import NoiseStep
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import prepare_reference, sums_from, sums_of
from jerkbench.filters.common import of_r_alone
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.kinematic.mixture import mix_alone
from jerkbench.kinematic.plugin_call import compiled_rule
from jerkbench.timeline import RecordedRun, build_timeline

PAIRS = [("baseline", "jerk"), ("jerk", "baseline"), ("baseline", "baseline"), ("bias", "bias")]
PAIRS += [("acceleration", "acceleration"), ("acceleration", "baseline")]


@cache
def recorded():
    recording = NoiseStep().apply(FieldWhite(duration_s=12.0).load(4), 0)
    return recording, Tilt().estimate(recording)


def compare(model, adaptation):
    timeline = build_timeline(*recorded())
    wanted = model._mixture(timeline, adaptation).to_the_end()
    got = model.estimate_compiled(*recorded(), adaptation)

    @cache
    def changed(seed):
        return model._mixture(with_other_last_bits(timeline, seed), adaptation).to_the_end()

    return agree_runs(timeline, got, wanted, changed), wanted


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_it_agrees_with_numpy_for_each_pair(first, second):
    compare(InteractingMultipleModels(first, second), Mtf())


@pytest.mark.parametrize("name", of_r_alone())
def test_it_agrees_with_numpy_with_each_adaptation(name):
    compare(InteractingMultipleModels(), plugins.create("adaptation", {"name": name}))


def test_an_adaptation_changes_what_both_filters_take_for_noise():
    model = InteractingMultipleModels()
    (_, plain), (_, adapted) = compare(model, NoAdaptation()), compare(model, Mtf())

    assert (adapted.updates.R_diagonal > plain.updates.R_diagonal).any()
    assert np.abs(adapted.position_m - plain.position_m).max() > 1e-3


@pytest.mark.slow
def test_its_sums_are_those_of_a_trajectory():
    (recording, attitude), model = recorded(), InteractingMultipleModels()
    timeline = build_timeline(recording, attitude)
    scene = prepare_reference(recording, timeline, 2.0)
    run = RecordedRun(recording, attitude, timeline, scene.scoring)
    one, _ = model.run_settings([run] * 2, [model] * 2, [Mtf()] * 2, updates=True, attitude=True, threads=2)
    estimate = model.estimate(recording, attitude, Mtf())
    wanted = sums_of(estimate, recording, counted_rows(estimate, recording, 2.0))
    got = sums_from(one, scene, recording)

    assert_same_sums(got, wanted)
    assert one.euler_rad is None
    np.testing.assert_allclose(one.updates.nis_used, estimate.updates.nis_used, rtol=1e-7)


def test_it_stops_where_numpy_stops():
    timeline = with_a_negative_variance(build_timeline(*recorded()), 50)
    model = InteractingMultipleModels()
    got = mix_alone(timeline, model.start(timeline), compiled_rule(Mtf()))
    wanted = model._mixture(timeline, Mtf()).to_the_end()

    assert_same_until_it_stops(got, wanted)
