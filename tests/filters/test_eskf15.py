"""The complete inertial filter on recordings with known truth."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.disturbances.outages import GnssOutage, PositionOutage
from jerkbench.errors import PluginError
from jerkbench.filters.eskf15 import Eskf15, InvariantEkf
from jerkbench.inertial.compiled_runs import solve_compiled
from jerkbench.presets import preset
from jerkbench.recording import Heading, Imu, Reference, Velocity
from jerkbench.simulation.sensors import ALLAN_FLOOR, BIAS_TIME_S, GRADES, with_sensor_errors
from synthetic import body_velocity, level_attitude, recording_at_rest

TACTICAL, CONSUMER = (
    replace(GRADES[name], gyro_scale_ppm=0.0, accel_scale_ppm=0.0, misalignment_mrad=0.0)
    for name in ("tactical", "consumer")
)
"""Without scale factors and misalignments, which the filter does not model."""


def tuned(grade):
    """The filter with the noise and the biases of the data sheet."""
    return Eskf15(
        grade.angle_random_walk_deg_per_sqrt_h,
        grade.velocity_random_walk_mps_per_sqrt_h,
        gyro_instability_deg_per_h=grade.gyro_instability_deg_per_h / ALLAN_FLOOR,
        gyro_correlation_s=BIAS_TIME_S,
        accel_instability_mg=grade.accel_instability_mg / ALLAN_FLOOR,
        accel_correlation_s=BIAS_TIME_S,
        gyro_turn_on_deg_per_h=grade.gyro_turn_on_deg_per_h,
        accel_turn_on_mg=grade.accel_turn_on_mg,
    )


def biased_drive(seed, imu):
    """A drive of the simulated field, and the (6,) gyro and accelerometer bias at its end."""
    dataset = FieldWhite(imu=imu, duration_s=36.0, reference_rate_hz=1.0)
    clean = dataset.load(seed)
    # the bias: the output of a sensor at rest without noise
    grade, rate, nothing = GRADES[imu], dataset.imu_rate_hz, np.zeros_like(clean.imu.gyro_radps)
    sensors = (grade.gyro(rate), "gyro"), (grade.accelerometer(rate), "accelerometer")
    shown = [with_sensor_errors(nothing, replace(e, noise=0.0), 1.0 / rate, seed, name) for e, name in sensors]
    return clean, np.concatenate([shown[0][-1], shown[1][-1]])


def error_and_covariance(model, recording, bias):
    """Truth minus estimate (15,) and its covariance (15, 15) at the last stamp of the reference."""
    solution = solve_compiled(model.inputs(recording, Tilt().estimate(recording)), NoAdaptation())
    reference, state = recording.reference, solution.state
    true = Rotation.from_euler("ZYX", reference.euler_rad[-1, ::-1])
    phi = (true * Rotation.from_matrix(state.dcm).inv()).as_rotvec()
    biases = bias - np.concatenate([state.gyro_bias_radps, state.accel_bias_mps2])
    position, velocity = reference.enu_m[-1] - state.position_m, reference.velocity_mps[-1] - state.velocity_mps
    return np.concatenate([position, velocity, phi, biases]), solution.covariance


def outcomes_of(model, seeds, imu):
    """NEES of the full state (15) and of position and velocity (6), and the largest error of a bias over its sigma."""
    found = []
    for seed in range(seeds):
        error, P = error_and_covariance(model, *biased_drive(seed, imu))
        nees = (error[:n] @ np.linalg.solve(P[:n, :n], error[:n]) for n in (15, 6))
        found.append([*nees, np.max(np.abs(error[9:]) / np.sqrt(np.diag(P)[9:]))])
    return np.array(found).T


def in_its_band(nees, states):
    """True if the mean of independent NEES lies in its 95 % band."""
    low, high = chi2.ppf([0.025, 0.975], states * len(nees)) / len(nees)
    return low < nees.mean() < high


@pytest.fixture(scope="module")
def field():
    """A noise-free drive of the simulated robot, with the reference at the rate of the fixes."""
    return FieldWhite(duration_s=30.0, noise=False, reference_rate_hz=5.0).load(1)


@pytest.fixture(scope="module")
def noisy_field():
    return FieldWhite(duration_s=30.0, reference_rate_hz=5.0).load(2)


def position_errors(model, recording):
    estimate = model.estimate_compiled(recording, Tilt().estimate(recording), NoAdaptation())
    assert estimate.failure == ""
    return estimate, np.linalg.norm(estimate.position_m - recording.reference.enu_m[estimate.index], axis=1)


def test_a_perfect_recording_gives_the_truth_also_with_body_velocities(field):
    estimate, error = position_errors(Eskf15(), field)
    truth = field.reference
    assert error.max() < 1e-3
    assert np.abs(estimate.velocity_mps - truth.velocity_mps[estimate.index]).max() < 3e-3
    turns = Rotation.from_euler("ZYX", estimate.euler_rad[:, ::-1])
    true = Rotation.from_euler("ZYX", truth.euler_rad[estimate.index][:, ::-1])
    assert (turns * true.inv()).magnitude().max() < 3e-3
    assert np.nanmax(estimate.updates.nis) < 0.1
    recording = shown_in_body(field)
    wrong = Tilt().estimate(field)  # errors of the attitude filter after the start have no effect
    late = np.arange(len(wrong.t_s)) > 100
    turn = Rotation.from_euler("x", 0.3).as_matrix()
    wrong = replace(wrong, dcm=np.where(late[:, None, None], wrong.dcm @ turn, wrong.dcm))
    estimate = Eskf15().estimate(recording, wrong, NoAdaptation())
    error = estimate.position_m - recording.reference.enu_m[estimate.index]
    assert np.abs(error).max() < 1e-3


def shown_in_body(recording):
    return replace(recording, velocity=replace(recording.velocity, frame="body", mps=body_velocity(recording)))


def with_wheel(recording, scale):
    """The recording with a wheel speed instead of the velocity."""
    shown = shown_in_body(recording).velocity
    return replace(recording, velocity=Velocity.along_course(shown.t_s, scale * shown.mps[:, 0], 0.03))


def test_the_scale_error_of_a_wheel_is_estimated(noisy_field):
    recording = PositionOutage(windows_s=((20.0, 30.0),)).apply(with_wheel(noisy_field, 1.05), 0)
    attitude = Tilt().estimate(recording)
    trusting, careful = (
        Eskf15(wheel_scale=w, nonholonomic=True, nonholonomic_sigma_mps=0.05).solve(recording, attitude, NoAdaptation())
        for w in (False, True)
    )
    late = careful.estimate.index >= 125  # from 25 s on
    errors = [
        np.linalg.norm(s.estimate.position_m - recording.reference.enu_m[s.estimate.index], axis=1)[late].max()
        for s in (trusting, careful)
    ]

    assert careful.covariance.shape == (16, 16)
    assert careful.state.wheel_scale == pytest.approx(0.05, abs=3 * np.sqrt(careful.covariance[15, 15]))
    assert careful.covariance[15, 15] < 0.005**2
    assert errors[1] < 0.5 * errors[0]


def test_lever_arms_of_wheel_and_antenna_are_used_and_absent_axes_ignored(field):
    arm = np.array([-1.5, 0.4, -0.6])
    recording = with_wheel(field, 1.0)
    rate = field.imu.gyro_radps[np.searchsorted(field.imu.t_s, recording.velocity.t_s - 1e-6)]
    there = recording.velocity.mps[:, 0] + np.cross(rate, arm)[:, 0]
    shown = replace(recording, velocity=Velocity.along_course(recording.velocity.t_s, there, 0.03))
    estimate, _ = position_errors(Eskf15(nonholonomic_point_m=tuple(arm)), shown)
    assert np.nanmax(estimate.updates.nis) < 0.1
    assert set(estimate.updates.rows) <= {1.0, 4.0}
    arm = np.array([0.8, -0.4, 1.5])
    rows = np.searchsorted(field.reference.t_s, field.position.t_s - 1e-6)
    turn = Rotation.from_euler("ZYX", field.reference.euler_rad[rows][:, ::-1])
    antenna = replace(field.position, enu_m=field.position.enu_m + turn.apply(arm))
    recording = replace(field, position=antenna, velocity=None)
    _, ignored = position_errors(Eskf15(), recording)
    _, at_imu = position_errors(Eskf15(antenna_m=tuple(arm)), recording)
    back = Eskf15(antenna_m=tuple(arm), reference_point_m=tuple(arm)).estimate(
        recording, Tilt().estimate(field), NoAdaptation()
    )
    assert at_imu.max() < 1e-2
    assert ignored.max() > 1.0
    shown = replace(recording, reference=Reference(antenna.t_s, "", independent=True, enu_m=antenna.enu_m))
    assert np.abs(back.position_m - shown.reference.enu_m[-len(back.index) :]).max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imu", "grade", "kind"),
    [("tactical", TACTICAL, Eskf15), ("consumer", CONSUMER, Eskf15), ("tactical", TACTICAL, InvariantEkf)],
)
def test_the_grades_of_imu_are_consistent_too(imu, grade, kind, monkeypatch):
    """The invariant filter is tested with the tactical grade only: with large biases its NEES is too high."""
    monkeypatch.setitem(GRADES, imu, grade)
    nees, of_navigation, biases = outcomes_of(kind(**asdict(tuned(grade))), 20, imu)

    assert in_its_band(nees, 15)
    assert in_its_band(of_navigation, 6)
    assert (biases < 3.0).sum() >= 19


@pytest.mark.parametrize("name", [*GRADES, "drive"])
def test_there_is_a_preset_of_both_filters_for_each_grade_of_imu(name):
    mine, other = (plugins.create("filter", preset("filter", f"{kind}_{name}")) for kind in ("iekf", "eskf15"))

    assert isinstance(mine, InvariantEkf)
    made = asdict(mine)
    assert made == asdict(other)
    if name in GRADES:
        requested = asdict(tuned(GRADES[name]))
        given = {key: value for key, value in made.items() if isinstance(value, float)}
        assert given == pytest.approx({key: requested[key] for key in given}, rel=1e-3)
        assert all(value == requested[key] for key, value in made.items() if key not in given)


def rotating_recording(t_end_s=20.0):
    """At rest at the origin, with headings 90 degrees away from the initial yaw, across the branch of atan2."""
    rest = recording_at_rest(duration_s=t_end_s, velocity=None, static_start_s=2.0)
    t_s = np.arange(1, 5 * int(t_end_s)) / 5.0
    return replace(rest, heading=Heading(t_s, np.full(len(t_s), -3.1), np.full(len(t_s), 0.01)))


def test_headings_correct_the_yaw_along_the_shorter_way():
    recording = rotating_recording()
    attitude = level_attitude(recording)
    attitude = replace(attitude, euler_rad=attitude.euler_rad + np.array([0.0, 0.0, 3.0]))
    model = Eskf15(initial_yaw_sigma_rad=0.3)
    used, unused = (
        replace(model, use_heading=use).estimate(recording, attitude, NoAdaptation()).euler_rad[:, 2]
        for use in (True, False)
    )

    assert used[-1] == pytest.approx(-3.1, abs=1e-3)
    assert np.abs(np.abs(used) - np.pi).max() < 0.15  # never through 0
    np.testing.assert_allclose(unused, 3.0, atol=1e-6)


def drifting(seed=3, length_s=30.0):
    """A body at rest without fixes, whose position drifts because of its accelerometer."""
    rest = recording_at_rest(duration_s=length_s, velocity=None, static_start_s=2.0)
    rng = np.random.default_rng(seed)
    n = len(rest.imu.t_s)
    imu = Imu(
        rest.imu.t_s,
        rest.imu.accel_mps2 + rng.normal(0.0, 0.02, (n, 3)) + [0.03, -0.02, 0.0],
        rng.normal(0.0, 0.0017, (n, 3)),
    )
    return GnssOutage(windows_s=((10.0, length_s),)).apply(replace(rest, imu=imu), 0)


def test_zero_velocity_updates_stop_the_drift_of_a_stationary_body_only(noisy_field):
    recording = drifting()
    free, held = (position_errors(Eskf15(zero_velocity=z), recording)[1].max() for z in (False, True))
    assert held < 0.2
    assert free > 5.0 * held
    free, held = (position_errors(Eskf15(zero_velocity=z), noisy_field)[1] for z in (False, True))
    moving = noisy_field.reference.t_s[-len(free) :] > 8.0
    np.testing.assert_allclose(held[moving], free[moving], atol=5e-3)


def test_a_constant_velocity_is_not_detected_as_a_stop():
    rest = recording_at_rest(duration_s=20.0)
    speed = np.array([5.0, 0.0, 0.0])
    fixes, velocity, truth = rest.position, rest.velocity, rest.reference
    recording = replace(
        rest,
        position=replace(fixes, enu_m=fixes.t_s[:, None] * speed),
        velocity=replace(velocity, mps=velocity.mps + speed),
        reference=replace(truth, enu_m=truth.t_s[:, None] * speed, velocity_mps=truth.velocity_mps + speed),
    )
    model = Eskf15(zero_velocity=True)
    estimate = model.estimate(recording, level_attitude(recording), NoAdaptation())

    np.testing.assert_allclose(estimate.velocity_mps[-1], speed, atol=1e-3)


def test_the_non_holonomic_constraint_helps_through_an_outage(noisy_field):
    recording = GnssOutage(windows_s=((15.0, 30.0),)).apply(noisy_field, 0)
    free = Eskf15(use_heading=False, nonholonomic_sigma_mps=0.05)
    without, bound = (position_errors(m, recording)[1].max() for m in (free, replace(free, nonholonomic=True)))

    assert bound < 0.6 * without


def test_the_fix_sigma_replaces_the_covariance_that_an_adaptation_receives(noisy_field):
    estimate, _ = position_errors(Eskf15(position_sigma_m=0.5), noisy_field)
    np.testing.assert_allclose(estimate.updates.R_diagonal[:, :3], 0.25)
    np.testing.assert_allclose(estimate.updates.R_diagonal[:, 3:5], 0.03**2)


def test_the_yaw_of_the_track_is_sufficient(field):
    recording = replace(field, velocity=None, heading=None)
    attitude = Tilt().estimate(recording)  # without a course and a heading, its yaw starts at 0
    estimate = Eskf15(yaw_source="track", initial_yaw_sigma_rad=0.2).estimate(recording, attitude, NoAdaptation())
    off = estimate.euler_rad[-1, 2] - recording.reference.euler_rad[estimate.index[-1], 2]

    assert abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi) < 0.02


def test_noise_is_given_in_the_units_of_data_sheets():
    model = Eskf15(6.0, 1.8, gyro_instability_deg_per_h=20.0, accel_instability_mg=0.1, accel_correlation_s=100.0)
    noise = model.sensor_noise()

    assert noise.angle == pytest.approx(np.deg2rad(0.1) ** 2)  # 6 deg/sqrt(h) are .1 deg/sqrt(s)
    assert noise.velocity == pytest.approx(0.03**2)
    assert noise.gyro_bias == pytest.approx(2.0 * np.deg2rad(20.0 / 3600.0) ** 2 / 1000.0)
    assert noise.accel_bias == pytest.approx(2.0 * (1e-4 * 9.81) ** 2 / 100.0)


def test_it_reports_a_divergence(noisy_field):
    wild = replace(noisy_field.imu, accel_mps2=noisy_field.imu.accel_mps2.copy())
    spoiled = wild.accel_mps2.copy()
    spoiled[2000:] = 1e300
    recording = replace(noisy_field, imu=replace(wild, accel_mps2=spoiled))
    with np.errstate(all="ignore"):
        estimate = Eskf15().estimate(recording, Tilt().estimate(noisy_field), NoAdaptation())

    assert estimate.failure.startswith("the covariance is no longer positive definite at 20.")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"position_sigma_m": 0.0}, "position_sigma_m is 0.0; it must be positive"),
        ({"antenna_m": (1.0, 2.0)}, "give three numbers: forward, left, up"),
    ],
)
def test_an_invalid_parameter_raises(parameters, message):
    with pytest.raises(PluginError, match=message):
        Eskf15(**parameters)
