"""Initial states and the noise that the initial covariance states."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import jerkbench
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.errors import PluginError
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.inertial.run_inputs import with_body_velocity
from jerkbench.inertial.state import NavigationState, rotation_exp
from jerkbench.parameters import RScale, scale_of
from jerkbench.recording import Imu, Position, Velocity
from jerkbench.timeline import (
    INITIAL_SPEED_SIGMA_MPS,
    INPUT_SIGMA_MPS2,
    UNSEEN_SIGMA_MPS2,
    build_timeline,
    scaled_timeline,
    with_r_scale,
)
from synthetic import level_attitude, recording_at_rest

FULL = np.array([[0.04, 0.01, -0.02], [0.01, 0.09, 0.03], [-0.02, 0.03, 0.16]])


def recording(fix_s, velocity, begin_s=0.0, duration_s=3.0):
    """An IMU from ``begin_s`` on, and one fix."""
    whole = recording_at_rest(
        duration_s=duration_s, position=Position([fix_s], np.zeros((1, 3)), 0.01 * np.eye(3)[None]), velocity=velocity
    )
    kept = whole.imu.t_s > begin_s
    return replace(whole, imu=Imu(*(getattr(whole.imu, name)[kept] for name in ("t_s", "accel_mps2", "gyro_radps"))))


def test_the_covariance_of_each_measured_velocity_is_kept():
    one = recording(1.0, Velocity([1.0], [[5.0, 6.0, 7.0]], FULL[None]))
    timeline = build_timeline(one, level_attitude(one))
    np.testing.assert_array_equal(timeline.P0[3:, 3:], FULL)
    np.testing.assert_array_equal(timeline.x0[3:], [5.0, 6.0, 7.0])
    nan = np.nan
    one = recording(1.0, Velocity([0.9, 1.0], [[1.0, 2.0, nan], [nan, nan, 3.0]], [FULL, FULL]))
    P0 = build_timeline(one, level_attitude(one)).P0
    assert P0[3, 4] == FULL[0, 1]
    np.testing.assert_array_equal(P0[3:5, 5], 0.0)
    assert P0[5, 5] == FULL[2, 2]


def test_an_old_velocity_is_moved_to_the_start_and_becomes_less_sure():
    one = recording(1.7, Velocity([0.995], [[5.0, 6.0, 7.0]], FULL[None]))
    t_s = one.imu.t_s - 0.005  # the middle of each sample
    u = np.column_stack([np.sin(2 * t_s), 3.0 * t_s, np.full(len(t_s), -0.5)])
    timeline = build_timeline(one, level_attitude(one, u))
    gained = [quad(f, 0.995, 1.7)[0] for f in (lambda t: np.sin(2 * t), lambda t: 3.0 * t, lambda _: -0.5)]
    np.testing.assert_allclose(timeline.x0[3:], np.array([5.0, 6.0, 7.0]) + gained, atol=1e-4)
    np.testing.assert_allclose(timeline.P0[3:, 3:], FULL + (0.705 * INPUT_SIGMA_MPS2) ** 2 * np.eye(3))
    one = recording(1.5, Velocity([0.8], [[5.0, 6.0, 7.0]], FULL[None]), begin_s=1.2)
    timeline = build_timeline(one, level_attitude(one, (2.0, 0.0, 0.0)))
    grown = (0.3 * INPUT_SIGMA_MPS2) ** 2 + (0.4 * UNSEEN_SIGMA_MPS2) ** 2
    np.testing.assert_allclose(timeline.x0[3:], [5.6, 6.0, 7.0])
    np.testing.assert_allclose(timeline.P0[3:, 3:], FULL + grown * np.eye(3))


def test_a_speed_says_nothing_across_the_course():
    one = recording(1.0, Velocity.along_course([1.0], [4.0], 0.5))
    course, cos, sin = np.pi / 6, np.cos(np.pi / 6), 0.5
    attitude = level_attitude(one)
    turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    attitude = replace(attitude, dcm=np.tile(turned, (len(attitude.t_s), 1, 1)))
    timeline = build_timeline(one, attitude)
    along = np.array([cos, sin, 0.0])

    np.testing.assert_allclose(timeline.x0[3:], 4.0 * along, atol=1e-9)
    wanted = 0.25 * np.outer(along, along) + INITIAL_SPEED_SIGMA_MPS**2 * (np.eye(3) - np.outer(along, along))
    np.testing.assert_allclose(timeline.P0[3:, 3:], wanted, rtol=1e-6, atol=1e-9)
    assert np.arctan2(timeline.x0[4], timeline.x0[3]) == pytest.approx(course)


def test_the_inertial_navigation_starts_with_the_velocity_of_its_start():
    """Constant acceleration forwards, the last velocity .8 s before the first fix: .8 m/s slower."""
    one = recording(2.0, Velocity.along_course([1.2], [4.0], 0.1, 0.1))
    imu = replace(one.imu, accel_mps2=one.imu.accel_mps2 + np.array([1.0, 0.0, 0.0]))
    t_s = imu.t_s[imu.t_s >= 2.0]
    zeros = np.zeros((len(t_s), 3))
    one = replace(one, imu=imu, reference=replace(one.reference, t_s=t_s, enu_m=zeros, velocity_mps=None, scored=None))
    estimate = Eskf15().estimate(one, level_attitude(one, (1.0, 0.0, 0.0)), NoAdaptation())

    np.testing.assert_allclose(estimate.velocity_mps[0], [4.8, 0.0, 0.0], atol=1e-9)
    assert estimate.covariance[0][3, 3] == pytest.approx(0.01 + (0.8 * INPUT_SIGMA_MPS2) ** 2)


def test_a_body_velocity_is_as_unsure_as_the_attitude_that_turns_it():
    """Against velocities turned with sampled attitudes."""
    rng = np.random.default_rng(3)
    P = np.diag([1.0, 1.0, 1.0, 0.01, 0.02, 0.03, 1e-3, 2e-3, 4e-3, *6 * [1e-6]])
    state = NavigationState(np.zeros(3), np.array([3.0, 4.0, 1.0]), np.eye(3), np.zeros(3), np.zeros(3))
    moved, P_out = with_body_velocity(state, P, np.eye(3))
    errors = rng.multivariate_normal(np.zeros(6), P[3:9, 3:9], 40_000)
    true = [rotation_exp(e[3:]) @ (state.velocity_mps + e[:3]) for e in errors]
    sampled = np.cov(np.column_stack([true - state.velocity_mps, errors[:, 3:]]).T)

    np.testing.assert_array_equal(moved.velocity_mps, state.velocity_mps)
    np.testing.assert_allclose(P_out[3:9, 3:9], sampled, atol=2e-3)


SCALE = RScale(position=4.0, velocity=0.25)
SHORT = {"name": "field", "duration_s": 12.0}


def noisy(**replaced):
    recording = recording_at_rest(duration_s=5.0, **replaced)
    rng = np.random.default_rng(1)
    p = recording.position
    return dataclasses.replace(
        recording, position=dataclasses.replace(p, enu_m=p.enu_m + 0.01 * rng.standard_normal(p.enu_m.shape))
    )


def test_reported_covariances_are_scaled_and_nothing_else():
    recording = noisy()
    seen = with_r_scale(recording, SCALE)
    assert np.array_equal(seen.position.enu_m, recording.position.enu_m)
    assert seen.position.covariance_m2[0, 0, 0] == pytest.approx(4 * 0.01**2)
    assert seen.velocity.covariance_m2ps2[0, 0, 0] == pytest.approx(0.25 * 0.03**2)
    assert seen.imu is recording.imu
    assert seen.reference is recording.reference
    seen = with_r_scale(noisy(), SCALE)
    assert np.array_equal(seen.position.true_covariance_m2, noisy().position.covariance_m2)
    assert np.array_equal(seen.velocity.true_covariance_m2ps2, noisy().velocity.covariance_m2ps2)


NOISY = noisy()
WHEEL = Velocity.along_course(NOISY.velocity.t_s, np.ones(len(NOISY.velocity.t_s)), 0.1)


@pytest.mark.parametrize(
    "recording",
    [
        NOISY,
        noisy(velocity=None),
        dataclasses.replace(NOISY, velocity=WHEEL),
        dataclasses.replace(NOISY, velocity=dataclasses.replace(NOISY.velocity, frame="body")),
        noisy(position_sigma_m=0.0011),
        noisy(position_sigma_m=0.0005),
    ],
    ids=["both", "position alone", "wheel", "body", "scaled below the floor", "reported below the floor"],
)
@pytest.mark.parametrize("scale", [SCALE, RScale(position=0.1), RScale(2.7, 0.3)])
def test_the_quick_way_makes_the_timeline_of_what_is_told(recording, scale):
    attitude = level_attitude(recording)
    whole = build_timeline(with_r_scale(recording, scale), attitude)
    before = build_timeline(recording, attitude)

    quick = scaled_timeline(before, recording, attitude, scale)

    assert quick.accel_enu_mps2 is before.accel_enu_mps2
    assert quick.measurements.z is before.measurements.z
    there = np.isfinite(before.measurements.z)
    pairs = there[:, :, None] & there[:, None, :]
    for name in ("R", "R_true"):
        quickly, wholly = (getattr(of.measurements, name)[pairs] for of in (quick, whole))
        np.testing.assert_array_equal(quickly, wholly)
    np.testing.assert_array_equal(quick.x0, whole.x0)
    np.testing.assert_array_equal(quick.P0, whole.P0)


@pytest.mark.parametrize("model", ["jerk", pytest.param("imm", marks=pytest.mark.slow)])
def test_both_ways_to_run_see_what_is_told_and_scale_the_nis_with_it(model):
    def run(engine, scale):
        return jerkbench.run(dataset=SHORT, filter=model, engine=engine, seeds=1, r_scale=scale).iloc[0]

    (fast, slow), plain = (run(engine, {"position": 9.0}) for engine in ("compiled", "filterpy")), run("compiled", None)

    assert fast["noise"] == "r_scale.position=9"
    assert plain["noise"] == "default"
    assert fast["position_rmse_m"] == pytest.approx(slow["position_rmse_m"], rel=1e-6)
    assert fast["position_rmse_m"] != pytest.approx(plain["position_rmse_m"], rel=1e-3)
    assert fast["anis_per_row"] == pytest.approx(slow["anis_per_row"], rel=1e-6)
    assert fast["anis_per_row"] < plain["anis_per_row"]


@pytest.mark.parametrize(
    "values",
    [
        *({"velocity": value} for value in (0.0, -1.0, float("nan"), float("inf"))),
        *(float("inf"), "abc", [1.0], {"position": "2"}, {"position": True}, {3: 1.0}, {"positon": 2.0}),
    ],
)
def test_only_positive_factors_of_position_and_velocity_are_accepted(values):
    with pytest.raises(PluginError, match=r"r_scale.*(position|positive number)"):
        scale_of(values)
    with pytest.raises(PluginError, match=r"r_scale.*position"):
        jerkbench.run(dataset=SHORT, seeds=1, r_scale={"positon": 2.0})
    assert scale_of(None) == scale_of({}) == RScale()
    assert scale_of({"position": 2}) == RScale(position=2.0)
