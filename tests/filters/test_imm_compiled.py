"""The compiled mixture against the NumPy mixture, for pairs of models and for adaptations."""

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
from jerkbench.filters.common import adaptations_of_r
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.kinematic.mixture import mix_single
from jerkbench.kinematic.rules import compiled_rule
from jerkbench.timeline import RecordedRun, build_timeline

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

    return agree_runs(timeline, got, requested, changed), requested


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_it_agrees_with_numpy_for_each_pair(first, second):
    compare(InteractingMultipleModels(first, second), Mtf())


@pytest.mark.parametrize("name", adaptations_of_r())
def test_it_agrees_with_numpy_with_each_adaptation(name):
    compare(InteractingMultipleModels(), plugins.create("adaptation", {"name": name}))


def test_an_adaptation_changes_the_noise_of_both_filters():
    model = InteractingMultipleModels()
    (_, plain), (_, adapted) = compare(model, NoAdaptation()), compare(model, Mtf())

    assert (adapted.updates.R_diagonal > plain.updates.R_diagonal).any()
    assert np.abs(adapted.position_m - plain.position_m).max() > 1e-3


@pytest.mark.slow
def test_sums_agree_with_the_trajectory():
    (recording, attitude), model = recorded(), InteractingMultipleModels()
    timeline = build_timeline(recording, attitude)
    scene = prepare_reference(recording, timeline, 2.0)
    run = RecordedRun(recording, attitude, timeline, scene.scoring)
    one, _ = model.run_settings([run] * 2, [model] * 2, [Mtf()] * 2, updates=True, attitude=True, threads=2)
    estimate = model.estimate(recording, attitude, Mtf())
    requested = sums_of(estimate, recording, counted_rows(estimate, recording, 2.0))
    got = sums_from(one, scene, recording)

    assert_same_sums(got, requested)
    assert one.euler_rad is None
    np.testing.assert_allclose(one.updates.nis_used, estimate.updates.nis_used, rtol=1e-7)


def test_it_diverges_at_the_same_time_as_numpy():
    timeline = with_a_negative_variance(build_timeline(*recorded()), 50)
    model = InteractingMultipleModels()
    got = mix_single(timeline, model.start(timeline), compiled_rule(Mtf()))
    requested = model._mixture(timeline, Mtf()).run()

    assert_same_until_it_stops(got, requested)
