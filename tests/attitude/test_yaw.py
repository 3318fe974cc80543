"""The yaw filter, the headings and courses that it reads, and the notes on a yaw that is not measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.attitude.reference import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.yaw import (
    FINE_RAD,
    MAX_CHORD_S,
    chords_of,
    course_headings,
    estimate_yaw,
    select_headings,
    yaw_rate,
)
from jerkbench.contracts import Remarking
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, euler_from_dcm
from jerkbench.inspection.facts import yaw_line
from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity
from synthetic import recording_at_rest

WALK = 0.05


def level_yaw(t, rate, source, walk):
    """Yaw of a level body that turns at ``rate``."""
    zero = np.zeros(len(t))
    imu = Imu(t, np.zeros((len(t), 3)), np.column_stack([zero, zero, rate]))
    return estimate_yaw(imu, zero, zero, source, walk).rad


def wrap(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def drive(seed=0, n=400):
    """Irregular samples, a fast turn, and noisy headings between the stamps that cross pi."""
    rng = np.random.default_rng(seed)
    dt = rng.uniform(0.005, 0.02, n)
    t = np.cumsum(dt)
    rate = 1.5 + rng.normal(size=n)
    t_z = np.sort(rng.uniform(t[20], t[-1], 25))
    t_z[3] = t[np.searchsorted(t, t_z[3])]  # one of them exactly at a stamp
    truth = np.interp(t_z, np.concatenate([[0], t]), np.concatenate([[0], np.cumsum(dt * rate)]))
    z = wrap(truth + 2.9 + 0.1 * rng.normal(size=25))
    return t, dt, rate, Heading(t_z, z, rng.uniform(0.05, 0.2, 25))


def naive_yaw(t, dt, rate, headings, walk):
    """A filter with the yaw as its state, predicted sample by sample and split at each heading."""
    pending = list(zip(headings.t_s, headings.yaw_rad, headings.sigma_rad, strict=True))
    yaw = P = None
    out = np.full(len(t), np.nan)
    for k in range(len(t)):
        now = t[k] - dt[k]
        while pending and pending[0][0] <= t[k]:
            t_z, z, sigma = pending.pop(0)
            if yaw is None:
                yaw, P = z, sigma**2
            else:
                yaw += (t_z - now) * rate[k]
                P += (t_z - now) * walk**2
                K = P / (P + sigma**2)
                yaw += K * wrap(z - yaw)
                P -= K * P
            now = t_z
        if yaw is not None:
            yaw += (t[k] - now) * rate[k]
            P += (t[k] - now) * walk**2
            out[k] = wrap(yaw)
    return out


@pytest.mark.parametrize("seed", range(3))
def test_the_offset_filter_equals_the_filter_of_the_yaw(seed):
    t, dt, rate, headings = drive(seed)
    yaw = level_yaw(t, rate, headings, WALK)
    expected = naive_yaw(t, dt, rate, headings, WALK)
    after = t >= headings.t_s[0]
    assert np.isfinite(expected).sum() == after.sum()
    np.testing.assert_allclose(wrap(yaw - expected)[after], 0, atol=1e-11)
    assert (np.abs(np.diff(yaw)) > 6).any()  # the yaw crosses pi


def test_a_heading_has_no_effect_on_earlier_times_where_the_gyro_is_integrated():
    t, dt, rate, headings = drive()
    yaw = level_yaw(t, rate, headings, WALK)
    first = int(np.searchsorted(t, headings.t_s[0]))
    back = headings.yaw_rad[0] - (headings.t_s[0] - t[first - 1]) * rate[first]
    for k in range(first - 1, -1, -1):
        assert wrap(yaw[k] - back) == pytest.approx(0, abs=1e-12)
        back -= dt[k] * rate[k]
    yaw = level_yaw(np.array([1.0, 2.0]), np.array([2.0, 2.0]), None, WALK)
    np.testing.assert_allclose(yaw, [2.0, 4.0 - 2 * np.pi], atol=1e-12)


def test_yaw_rate_is_the_derivative_of_the_euler_angle():
    euler, gyro, h = np.array([0.3, -0.4, 1.0]), np.array([0.5, -0.7, 0.9]), 1e-6
    rotated = Rotation.from_matrix(dcm_from_euler(euler)) * Rotation.from_rotvec(h * gyro)
    numeric = (euler_from_dcm(rotated.as_matrix()[None])[0, 2] - euler[2]) / h
    assert yaw_rate(gyro[None], euler[:1], euler[1:2])[0] == pytest.approx(numeric, abs=1e-5)


IMU = Imu([0.0, 1.0], [[0, 0, 9.81]] * 2, np.zeros((2, 3)))
HEADING = Heading([0.5], [1.0], [0.01])
FAST = Velocity([0.5], [[3.0, 4.0, 0.0]], [np.eye(3)])
ODOMETRY = Heading([0.5], [1.2], [0.02], "odometry")
COURSE = Heading([0.5], [1.3], [0.02], "course")
SLOW = Velocity([0.5], [[0.3, 0.3, 2.0]], [np.eye(3)])
BODY = Velocity([0.5], [[5.0, 0.0, 0.0]], [np.eye(3)], frame="body")
SPEED = Velocity.along_course([0.5], [5.0], 0.5)


def recording(**parts):
    return Recording("farm", IMU, Reference([1.0], "nothing", independent=True), **parts)


def select(source, **parts):
    return select_headings(recording(**parts), source, 0.5, 0.0087)


def test_course_its_sigma_and_its_exceptions():
    R = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 1.0]])
    headings = course_headings(Velocity([2.0], [[-3.0, 4.0, 9.0]], [R]), 0.5, 0.0087)
    assert headings.t_s.tolist() == [2.0]
    assert headings.yaw_rad[0] == pytest.approx(math.pi - math.atan(4 / 3))
    # across (-3, 4)/5 is (-4, -3)/5: (16 * .04 + 2 * 12 * .01 + 9 * .09)/25
    assert headings.sigma_rad[0] == pytest.approx(math.sqrt((0.64 + 0.24 + 0.81) / 25) / 5)
    nan = math.nan
    mps = [[0.5, 0.0, 0.0], [nan, 2.0, 0.0], [2.0, nan, 0.0], [2.0, 0.0, nan]]
    headings = course_headings(Velocity(np.arange(4.0), mps, [1e-8 * np.eye(3)] * 4), 0.5, 0.0087)
    assert headings.t_s.tolist() == [3.0]
    assert headings.sigma_rad.tolist() == [0.0087]


def test_the_source_is_the_best_available_one_or_the_requested_one():
    assert select("auto", heading=HEADING, velocity=FAST) is HEADING
    assert select("auto", velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("auto", heading=Heading([], [], []), velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("auto", heading=ODOMETRY, velocity=FAST) is ODOMETRY
    for velocity in (None, SLOW, BODY, SPEED):
        assert select("auto", velocity=velocity) is None
    assert select("gyro_only", heading=HEADING, velocity=FAST) is None
    assert select("dual_antenna", heading=HEADING, velocity=FAST) is HEADING
    assert select("course", heading=HEADING, velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("odometry", heading=ODOMETRY, velocity=FAST) is ODOMETRY
    assert select("course", heading=COURSE, velocity=SPEED) is COURSE


@pytest.mark.parametrize(
    ("source", "velocity", "reason"),
    [
        ("dual_antenna", FAST, "farm has no dual-antenna heading; use"),
        ("odometry", FAST, "farm has no odometry heading; use"),
        ("course", None, "farm has no course over ground, because it has no velocity; use"),
        ("course", SPEED, "because its velocity is in the speed frame"),
        ("course", BODY, "because its velocity is in the body frame"),
        ("course", SLOW, "farm is never faster than 0.5 m/s"),
    ],
)
def test_a_missing_source_raises(source, velocity, reason):
    with pytest.raises(RecordingError, match=reason):
        select(source, velocity=velocity)


def fixes(t_s, enu_m, covariance):
    covariance = np.asarray(covariance, dtype=float)
    return Position(t_s, enu_m, np.tile(covariance, (len(t_s), 1, 1)) if covariance.ndim == 2 else covariance)


def along_east(speed_mps, sigma_m, duration_s=20.0, rate_hz=5.0, noise_m=0.0):
    t_s = np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    enu_m = np.column_stack([speed_mps * t_s, 0 * t_s, 0 * t_s])
    enu_m += noise_m * np.random.default_rng(0).normal(size=enu_m.shape)
    return fixes(t_s, enu_m, sigma_m**2 * np.eye(3))


def test_the_sigma_agrees_with_sampled_courses():
    first, second = np.diag([0.4, 0.1, 9.0]), np.array([[0.2, 0.1, 0.0], [0.1, 0.3, 0.0], [0.0, 0.0, 9.0]])
    way = np.array([60.0, -40.0])
    chords = chords_of(fixes([1.0, 3.0], [[0.0, 0.0, 0.0], [*way, 5.0]], np.array([first, second])), 0.0, 9.0)
    rng = np.random.default_rng(1)
    noise = [rng.multivariate_normal([0, 0], R[:2, :2], 100_000) for R in (first, second)]
    ways = way + noise[1] - noise[0]

    assert chords.way_m.tolist() == [way.tolist()]
    assert chords.sigma_rad[0] == pytest.approx(np.arctan2(ways[:, 1], ways[:, 0]).std(), rel=0.01)


@pytest.mark.parametrize(("speed_mps", "sigma_m"), [(10.0, 0.4), (1.5, 0.02), (20.0, 3.0)])
def test_chords_are_as_short_as_their_sigmas_allow_and_do_not_overlap(speed_mps, sigma_m):
    chords = chords_of(along_east(speed_mps, sigma_m, duration_s=60.0), 0.0, 60.0)
    needed_s = max(np.sqrt(2) * sigma_m / (FINE_RAD * speed_mps), 1.0 / speed_mps)

    assert (chords.begin_s[1:] >= chords.end_s[:-1]).all()
    assert (chords.sigma_rad <= FINE_RAD).all()
    np.testing.assert_allclose(chords.end_s - chords.begin_s, np.ceil(needed_s * 5.0 - 1e-9) / 5.0)


def test_after_a_rest_the_first_chord_starts_with_the_motion():
    t_s = np.arange(0.0, 30.0, 0.2)
    driven = 5.0 * np.maximum(t_s - 20.0, 0.0)
    chords = chords_of(fixes(t_s, np.column_stack([driven, 0 * t_s, 0 * t_s]), 0.04 * np.eye(3)), 0.0, 30.0)

    assert 19.9 <= chords.begin_s[0] < chords.end_s[0] < 21.5


@pytest.mark.parametrize("sigma_m", [0.01, 0.4, 5.0])
def test_fixes_at_rest_have_no_chord(sigma_m):
    position = along_east(0.0, sigma_m, duration_s=2000.0, noise_m=sigma_m)
    assert len(chords_of(position, 0.0, 2000.0).end_s) == 0


def test_a_slow_walk_with_noisy_fixes_has_a_few_coarse_chords():
    chords = chords_of(along_east(1.4, 3.0, duration_s=120.0), 0.0, 120.0)

    assert 2 <= len(chords.end_s) <= 4
    assert (chords.end_s - chords.begin_s <= MAX_CHORD_S).all()
    np.testing.assert_allclose(chords.sigma_rad, np.sqrt(2) * 3.0 / (1.4 * (chords.end_s - chords.begin_s)))


def test_fixes_that_are_incomplete_or_outside_the_imu_samples_are_ignored():
    position = along_east(10.0, 0.01)
    enu_m = position.enu_m.copy()
    enu_m[::2, 1] = np.nan
    chords = chords_of(fixes(position.t_s, enu_m, 1e-4 * np.eye(3)), 3.1, 8.1)

    ends = np.round(np.concatenate([chords.begin_s, chords.end_s]) * 5.0).astype(int)
    assert (ends % 2 == 1).all()
    assert chords.begin_s[0] >= 3.1
    assert chords.end_s[-1] <= 8.1
    assert len(chords_of(None, 0.0, 1.0).end_s) == len(chords_of(position, 30.0, 40.0).end_s) == 0


def driven(speed_mps, sigma_m):
    """A straight drive of two minutes with one fix per second and no other measurements."""
    rest = recording_at_rest(duration_s=120.0, imu_rate_hz=20, velocity=None)
    t_s = np.arange(1.0, 120.0)
    enu_m = np.column_stack([speed_mps * t_s, 0.0 * t_s, 0.0 * t_s])
    return replace(rest, position=Position(t_s, enu_m, np.tile(sigma_m**2 * np.eye(3), (len(t_s), 1, 1))))


@pytest.mark.parametrize("attitude", [Tilt(), GyroOnly(), Tilt(yaw_source="track")])
@pytest.mark.parametrize(
    ("speed_mps", "sigma_m", "note"),
    [
        (0.0, 1.0, "nothing measures the yaw"),
        (0.3, 2.0, "nothing measures the yaw"),
        (1.4, 3.0, "hardly observable"),
        (10.0, 0.4, "track of the fixes"),
    ],
)
def test_a_yaw_that_is_not_measured_has_a_note(attitude, speed_mps, sigma_m, note):
    recording = driven(speed_mps, sigma_m)

    assert isinstance(attitude, Remarking)
    assert note in yaw_line(recording)
    if attitude == Tilt(yaw_source="track") and note == "nothing measures the yaw":
        return  # an error, because the track was requested
    (message,) = attitude.remarks(recording)
    assert note in message


def test_a_yaw_that_is_measured_or_requested_has_no_note():
    field, rest = FieldWhite(duration_s=10.0).load(0), driven(0.0, 1.0)

    for recording in (field, replace(field, heading=None), replace(field, position=None, heading=None, velocity=None)):
        assert Tilt().remarks(recording) == ()
    assert Tilt(yaw_source="gyro_only").remarks(rest) == ()
    assert "headings of source dual_antenna" in yaw_line(field)
    assert "course of" in yaw_line(replace(field, heading=None))
    headed = replace(rest, heading=Heading([1.0], [0.5], [0.1]))
    assert Tilt().remarks(headed) == ()
