"""The compiled smoother against the NumPy smoother, for models and adaptations, separately and in batches."""

from dataclasses import replace
from functools import cache

import numpy as np
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
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import Field
from jerkbench.disturbances.noise import NoiseStep
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.rts import RauchTungStriebel, SmoothedFixes
from jerkbench.kinematic.rules import compiled_rule
from jerkbench.kinematic.smoother import smooth_one
from jerkbench.timeline import build_timeline

MODELS = ("baseline", "bias", "jerk")


@cache
def recorded(gap_s=(0.0, 0.0)):
    """A drive with a time of larger receiver noise, with missing rows, and with no rows within ``gap_s``."""
    recording = NoiseStep().apply(Field(duration_s=12.0).load(4), 0)
    velocity, position = recording.velocity, recording.position
    mps, enu_m = velocity.mps.copy(), position.enu_m.copy()
    mps[30:40, 1], mps[45:50] = np.nan, np.nan
    for part, values in ((velocity, mps), (position, enu_m)):
        values[(part.t_s > gap_s[0]) & (part.t_s < gap_s[1])] = np.nan
    recording = replace(recording, velocity=replace(velocity, mps=mps), position=replace(position, enu_m=enu_m))
    return recording, Tilt().estimate(recording)


def compare(model, adaptation):
    timeline = build_timeline(*recorded())
    requested = model.smooth(timeline, adaptation)
    got = smooth_one(timeline, model.kinematic_filter(), compiled_rule(adaptation))

    @cache
    def changed(seed):
        return model.smooth(with_other_last_bits(timeline, seed), adaptation)

    agree_runs(timeline, got, requested, changed)


SMOOTHERS = [*map(RauchTungStriebel, MODELS), *map(SmoothedFixes, ("constant_velocity", "acceleration"))]


@pytest.mark.slow
@pytest.mark.parametrize("smoother", SMOOTHERS)
def test_it_agrees_with_numpy_with_each_model(smoother):
    compare(smoother, NoAdaptation())


@pytest.mark.parametrize("name", RauchTungStriebel().adaptations)
def test_it_agrees_with_numpy_with_each_adaptation(name):
    compare(RauchTungStriebel("jerk"), plugins.create("adaptation", {"name": name}))


@pytest.mark.parametrize("name", [pytest.param("baseline", marks=pytest.mark.slow), *MODELS[1:]])
def test_in_a_gap_the_covariance_agrees_within_the_rounding_error_of_a_difference(name):
    recording, attitude = recorded((6.0, 10.0))
    model = RauchTungStriebel(name)
    requested = model.estimate(recording, attitude, NoAdaptation())
    got = model.estimate_compiled(recording, attitude, NoAdaptation())
    filtered = CompiledEngine().run(build_timeline(recording, attitude), model.kinematic_filter(), NoAdaptation())

    np.testing.assert_allclose(got.position_m, requested.position_m, rtol=0.0, atol=1e-9)
    variances = (np.einsum("nii->ni", estimate.covariance) for estimate in (got, requested, filtered))
    mine, theirs, prior = variances
    assert (prior / theirs).max() > 100.0
    assert np.abs((mine - theirs) / prior).max() < 1e-12


@pytest.mark.slow
def test_sums_of_a_batch_agree_with_the_trajectories():
    models = [RauchTungStriebel("jerk", accel_mps2=0.1 * (1 + k)) for k in range(3)]
    assert_batch_agrees(models, *recorded(), Mtf())


def test_if_the_filter_diverges_the_steps_before_are_smoothed():
    timeline = with_a_negative_variance(build_timeline(*recorded()), 50)
    model, rule = RauchTungStriebel("jerk"), compiled_rule(Mtf())
    got, requested = smooth_one(timeline, model.kinematic_filter(), rule), model.smooth(timeline, Mtf())

    assert_same_until_it_stops(got, requested)
