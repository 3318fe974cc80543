"""Eight inertial runs side by side against the trajectories of the NumPy one."""

from dataclasses import replace

import numpy as np
import pytest
from test_compiled_navigation import ARMS, BURN_IN_S, EARTH, HELD, SCALES, recorded, reference_run

from engine_agreement import assert_same_sums
from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.sums import scored, sums_from, sums_of
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.inertial.side_by_side.runs import goes_together, run_journeys
from jerkbench.kinematic.plugin_call import compiled_rule
from jerkbench.sums import RecordedRun
from jerkbench.timeline import build_timeline


def scene_of(recording, attitude):
    return scored(recording, build_timeline(recording, attitude), BURN_IN_S)


def together(journeys, scenes, adaptations):
    scorings = [scene.scoring for scene in scenes]
    rules = [compiled_rule(adaptation) for adaptation in adaptations]
    assert all(map(goes_together, journeys, scorings))
    return run_journeys(journeys, scorings, rules, updates=True, attitude=True, threads=1)


def assert_same(result, scene, recording, estimate):
    wanted = sums_of(estimate, recording, counted_rows(estimate, recording, BURN_IN_S))
    got = sums_from(result, scene, recording)
    assert_same_sums(got, wanted)
    np.testing.assert_allclose(result.euler_rad, estimate.euler_rad, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(result.updates.innovation, estimate.updates.innovation, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(result.updates.nis_used, estimate.updates.nis_used, rtol=1e-7)


def test_each_run_has_its_own_settings_headings_and_missing_rows():
    recording, attitude = recorded("enu")
    mps = recording.velocity.mps.copy()
    mps[20:30, 2], mps[40:45] = np.nan, np.nan
    torn = replace(recording, velocity=replace(recording.velocity, mps=mps))
    silent = replace(recording, heading=None)
    recordings = [recording, torn, silent, recording]
    models = [Eskf15(), Eskf15(), Eskf15(), Eskf15(accel_turn_on_mg=30.0, velocity_random_walk_mps_per_sqrt_h=0.5)]
    adaptations = [Mtf(), Mtf(), NoAdaptation(), plugins.create("adaptation", {"name": "chi2"})]
    journeys = [model.journey(own, attitude) for model, own in zip(models, recordings, strict=True)]
    scenes = [scene_of(own, attitude) for own in recordings]

    results = together(journeys, scenes, adaptations)

    for given in zip(results, scenes, recordings, journeys, adaptations, strict=True):
        result, scene, own, journey, adaptation = given
        assert_same(result, scene, own, reference_run(journey, adaptation).estimate)
    assert len({tuple(result.position_m2) for result in results}) == 4


@pytest.mark.parametrize("name", Eskf15().adaptations)
def test_it_agrees_with_numpy_with_each_adaptation(name):
    (recording, attitude), adaptation = recorded("enu"), plugins.create("adaptation", {"name": name})
    journey, scene = Eskf15().journey(recording, attitude), scene_of(recording, attitude)

    (result,) = together([journey], [scene], [adaptation])

    assert_same(result, scene, recording, reference_run(journey, adaptation).estimate)


def test_a_turn_of_more_than_a_tenth_of_a_radian_in_a_step():
    recording, attitude = recorded("enu")
    journey, scene = Eskf15(use_heading=False).journey(recording, attitude), scene_of(recording, attitude)
    gyro = journey.imu.gyro_radps.copy()
    gyro[300:310, 2] += 30.0
    gyro[310:320, 2] -= 30.0
    spun = journey._replace(imu=replace(journey.imu, gyro_radps=gyro))

    result, plain = together([spun, journey], [scene, scene], [NoAdaptation()] * 2)

    assert_same(result, scene, recording, reference_run(spun, NoAdaptation()).estimate)
    assert_same(plain, scene, recording, reference_run(journey, NoAdaptation()).estimate)


@pytest.mark.parametrize(
    "fields",
    [ARMS, HELD, pytest.param(SCALES, marks=pytest.mark.slow), EARTH],  # scales have a loop of their own
    ids=["arms", "held", "scales", "earth"],
)
def test_what_has_other_equations_goes_alone_and_gives_the_same(fields):
    (recording, attitude), model = recorded("enu"), Eskf15(**fields)
    scene = scene_of(recording, attitude)
    run = RecordedRun(recording, attitude, build_timeline(recording, attitude), scene.scoring)
    assert not goes_together(model.journey(recording, attitude), scene.scoring)

    models = [model, Eskf15()]
    results = model.run_settings([run] * 2, models, [Mtf()] * 2, updates=True, attitude=True, threads=1)

    for own, result in zip(models, results, strict=True):
        assert_same(result, scene, recording, own.estimate(recording, attitude, Mtf()))
