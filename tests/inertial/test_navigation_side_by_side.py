"""Eight inertial runs side by side against the trajectories of the NumPy one."""

from dataclasses import replace

import numpy as np
import pytest
from test_compiled_navigation import ARMS, BURN_IN_S, CASES, EARTH, HELD, recorded, reference_run

from engine_agreement import assert_same_sums
from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import prepare_reference, sums_from, sums_of
from jerkbench.filters.eskf15 import Eskf15, InvariantEkf
from jerkbench.inertial.compiled_runs import run_many_inertial
from jerkbench.timeline import build_timeline


def scene_of(recording, attitude):
    return prepare_reference(recording, build_timeline(recording, attitude), BURN_IN_S)


def together(journeys, scenes, adaptations):
    scorings = [scene.scoring for scene in scenes]
    return run_many_inertial(journeys, scorings, adaptations, updates=True, attitude=True, threads=1)


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
    journeys = [model.inputs(own, attitude) for model, own in zip(models, recordings, strict=True)]
    scenes = [scene_of(own, attitude) for own in recordings]

    results = together(journeys, scenes, adaptations)

    for given in zip(results, scenes, recordings, journeys, adaptations, strict=True):
        result, scene, own, journey, adaptation = given
        assert_same(result, scene, own, reference_run(journey, adaptation).estimate)
    assert len({tuple(result.position_m2) for result in results}) == 4


@pytest.mark.parametrize("name", Eskf15().adaptations)
def test_it_agrees_with_numpy_with_each_adaptation(name):
    (recording, attitude), adaptation = recorded("enu"), plugins.create("adaptation", {"name": name})
    journey, scene = Eskf15().inputs(recording, attitude), scene_of(recording, attitude)

    (result,) = together([journey], [scene], [adaptation])

    assert_same(result, scene, recording, reference_run(journey, adaptation).estimate)


def test_a_turn_of_more_than_a_tenth_of_a_radian_in_a_step():
    recording, attitude = recorded("enu")
    journey, scene = Eskf15(use_heading=False).inputs(recording, attitude), scene_of(recording, attitude)
    gyro = journey.imu.gyro_radps.copy()
    gyro[300:310, 2] += 30.0
    gyro[310:320, 2] -= 30.0
    spun = journey._replace(imu=replace(journey.imu, gyro_radps=gyro))

    result, plain = together([spun, journey], [scene, scene], [NoAdaptation()] * 2)

    assert_same(result, scene, recording, reference_run(spun, NoAdaptation()).estimate)
    assert_same(plain, scene, recording, reference_run(journey, NoAdaptation()).estimate)


MEASURED = {
    "body": ("body", ARMS),
    "wheel": ("speed", {"nonholonomic_point_m": (-0.5, 0.2, -0.3)}),
    "heading": ("heading", {}),
    "all with a wheel": pytest.param("speed", {**ARMS, **HELD, "wheel_scale": True}, marks=pytest.mark.slow),
}


@pytest.mark.parametrize(("kind", "fields"), MEASURED.values(), ids=MEASURED)
def test_whatever_it_measures(kind, fields):
    (recording, attitude), model = recorded(kind), Eskf15(**fields)
    journey, scene = model.inputs(recording, attitude), scene_of(recording, attitude)

    (result,) = together([journey], [scene], [Mtf()])

    assert_same(result, scene, recording, reference_run(journey, Mtf()).estimate)


def test_runs_of_one_vector_have_their_own_lever_arms_constraints_and_earth():
    recording, attitude = recorded("enu")
    fields = [{}, ARMS, HELD, EARTH, {**ARMS, **HELD, **EARTH}]
    journeys = [Eskf15(**own).inputs(recording, attitude) for own in fields]
    scene = scene_of(recording, attitude)

    results = together(journeys, [scene] * 5, [Mtf()] * 5)

    for journey, result in zip(journeys, results, strict=True):
        assert_same(result, scene, recording, reference_run(journey, Mtf()).estimate)
    assert len({tuple(result.position_m2) for result in results}) == 5


@pytest.mark.slow
@pytest.mark.parametrize("case", ["lever arms", "heading", "all with a wheel"])
def test_the_invariant_one_too(case):
    kind, fields = CASES[case]
    (recording, attitude), model = recorded(kind), InvariantEkf(**fields, initial_yaw_sigma_rad=0.5)
    journey, scene = model.inputs(recording, attitude), scene_of(recording, attitude)

    (result,) = together([journey], [scene], [Mtf()])

    assert_same(result, scene, recording, reference_run(journey, Mtf()).estimate)
