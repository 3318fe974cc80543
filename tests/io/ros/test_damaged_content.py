"""Recordings in which something is wrong with the messages: each ends in its sentence or entry of the report."""

import numpy as np
import pytest

from bag_maker import Drive, fixposition
from jerkbench.errors import RecordingError

IMU, FIX, ODOMETRY = "/fixposition/poiimu", "/fixposition/gnss1", "/fixposition/odometry_ecef"
YEAR_1980, FLIPPED_BIT_S = 315_964_800, 2.0**31 / 16


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """What the drive is when nothing is wrong with it."""
    return load(Drive(duration_s=6.0), tmp_path_factory.mktemp("sound"))


def load(drive, folder, **options):
    (folder / "a.bag").unlink(missing_ok=True)
    return fixposition(str(drive.write(folder / "a.bag")), **options).load(0)


def set_stamp(message, ns):
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def shifted(first, last, seconds):
    """A function that shifts the stamps of these samples of the IMU."""

    def change(drive):
        for message in drive.messages(IMU)[first:last]:
            set_stamp(message, stamp_ns(message) + round(seconds * 1e9))

    return change


def everything_in_1980(drive):
    start = stamp_ns(drive.messages(IMU)[0])
    for topic in drive.rows:
        for message in drive.messages(topic):
            set_stamp(message, YEAR_1980 * 10**9 + stamp_ns(message) - start)


def zero_stamps(drive):
    for message in drive.messages(IMU)[100:110]:
        set_stamp(message, 0)


def repeated(drive):
    for before, after in zip(drive.messages(IMU)[50:60], drive.messages(IMU)[51:61], strict=True):
        if stamp_ns(after) % 40_000_000 == 0:
            set_stamp(after, stamp_ns(before))


def frozen_in_the_middle(drive):
    for message in drive.messages(IMU)[100:120]:
        message.angular_velocity = drive.messages(IMU)[100].angular_velocity


def lost_samples(drive):
    del drive.rows[IMU][100:150]


def lost_fixes(drive):
    del drive.rows[FIX][10:15]


def no_status(drive):
    for message in drive.messages(FIX)[3:6]:
        message.status.status = -1
        message.latitude = message.longitude = message.altitude = 0.0
        message.position_covariance[:] = 0.0


def zero_coordinates(drive):
    drive.messages(FIX)[4].latitude = drive.messages(FIX)[4].longitude = 0.0


def zero_covariance(drive):
    for message in drive.messages(FIX)[3:8]:
        message.position_covariance[:] = 0.0


def zero_quaternion(drive):
    q = drive.messages(ODOMETRY)[5].pose.pose.orientation
    q.x = q.y = q.z = q.w = 0.0


def given(topic, row, path, value):
    """A function that sets a number of one message, or multiplies it if ``value`` is a factor in a list."""

    def change(drive):
        *parts, name = path.split(".")
        part = drive.messages(topic)[row]
        for each in parts:
            part = getattr(part, each)
        setattr(part, name, getattr(part, name) * value[0] if isinstance(value, list) else value)

    return change


NAN, POSE = float("nan"), "pose.pose.position"
nan_covariance, indefinite_covariance, skew_covariance, huge_covariance = (
    given(FIX, 3, "position_covariance", np.array(values, dtype=float))
    for values in (
        (4e-4, 0, 0, 0, NAN, 0, 0, 0, 9e-4),
        (1, 2, 0, 2, 1, 0, 0, 0, 1),
        (4e-4, 3e-4, 0, 0, 1e-4, 0, 0, 0, 9e-4),
        (1e300 * np.eye(3)).ravel(),
    )
)
NOT_ON_EARTH = "1 of 30 rows have a position that is not on Earth"
LEAP = "1 of 30 rows have a position more than 50 m from its neighbours"
INDEFINITE = "covariance that is zero, NaN or not positive definite"
NOT_DEFINITE = f"1 of 30 rows have a position {INDEFINITE}"
NO_QUATERNION = "1 of 60 rows have an orientation that is not a unit quaternion"
WITHOUT_ONE = {"velocity": 59, "reference": 59}
LESS_IMU, LESS_FIX = {"imu": 299}, {"position": 29}
ACCEL, GYRO, TWIST = "linear_acceleration", "angular_velocity", "twist.twist.linear"

KEPT = [  # what is done, what the report says, and how many rows of which stream are left of 300, 30, 60
    (everything_in_1980, "300 of 300 rows have a stamp before 2000", {}),
    (zero_stamps, "10 of 300 rows have a stamp before 2000", {}),
    (repeated, "5 of 300 rows have the stamp of another row", {"imu": 295}),
    (shifted(120, 122, -0.05), "2 of 300 rows have a stamp older than a previous row: sorted.", {}),
    (shifted(200, 205, -3.0), "5 of 300 rows have a stamp that was set back by seconds", {"imu": 295}),
    (shifted(150, 151, FLIPPED_BIT_S), "1 of 300 rows have a stamp far from the time of recording", LESS_IMU),
    (frozen_in_the_middle, "19 of 300 rows have a frozen angular rate", {"imu": 281}),
    (given(IMU, 7, f"{ACCEL}.x", NAN), "1 of 300 rows have a specific force that is NaN or infinite", LESS_IMU),
    (given(IMU, 7, f"{GYRO}.z", np.inf), "1 of 300 rows have an angular rate that is NaN or infinite", LESS_IMU),
    (given(IMU, 7, f"{ACCEL}.x", 1e300), "1 of 300 rows have a specific force beyond 1000 m/s2", LESS_IMU),
    (given(IMU, 7, f"{GYRO}.x", -4e5), "1 of 300 rows have an angular rate beyond 100 rad/s", LESS_IMU),
    (lost_samples, "1 of 250 rows have a gap before them, up to 1.02 s", {"imu": 250}),
    (lost_fixes, "1 of 25 rows have a gap before them, up to 1.20 s", {"position": 25}),
    (no_status, "3 of 30 rows have status -1 (no fix)", {"position": 27}),
    (zero_coordinates, "1 of 30 rows have a position of zeros (no fix): dropped", {"position": 29}),
    (given(FIX, 4, "latitude", NAN), "1 of 30 rows have a position that is NaN or infinite", {"position": 29}),
    (given(FIX, 4, "latitude", 212.0), NOT_ON_EARTH, {"position": 29}),
    (given(FIX, 4, "altitude", -1e7), NOT_ON_EARTH, {"position": 29}),
    (given(FIX, 8, "longitude", [1.001]), LEAP, LESS_FIX),  # 1.1 km
    (given(FIX, 0, "longitude", 10.01), LEAP, LESS_FIX),
    (zero_covariance, "5 of 30 rows have a position covariance that is zero, NaN or not positive definite", {}),
    (nan_covariance, NOT_DEFINITE, {}),
    (indefinite_covariance, NOT_DEFINITE, {}),
    (skew_covariance, NOT_DEFINITE, {}),
    (huge_covariance, NOT_DEFINITE, {}),
    (zero_quaternion, NO_QUATERNION, WITHOUT_ONE),
    (given(ODOMETRY, 5, "pose.pose.orientation.w", [1e3]), NO_QUATERNION, WITHOUT_ONE),
    (given(ODOMETRY, 5, f"{POSE}.x", [2]), "1 of 60 rows have a position that is not on Earth", WITHOUT_ONE),
    (given(ODOMETRY, 5, f"{POSE}.y", NAN), "1 of 60 rows have a position that is NaN or infinite", WITHOUT_ONE),
    (given(ODOMETRY, 5, f"{TWIST}.x", 3e8), "1 of 60 rows have a velocity beyond 200 m/s", WITHOUT_ONE),
    (given(ODOMETRY, 5, "twist.covariance", np.zeros(36)), f"1 of 60 rows have a velocity {INDEFINITE}", {}),
]


@pytest.mark.parametrize(("harm", "said", "left"), KEPT)
def test_trouble_is_counted_and_the_rest_is_as_it_was(tmp_path, sound, harm, said, left):
    drive = Drive(duration_s=6.0)
    harm(drive)
    recording = load(drive, tmp_path)
    assert any(said in note for note in recording.notes), recording.notes
    rows = {name: len(getattr(recording, name).t_s) for name in ("imu", "position", "velocity", "reference")}
    assert rows == {"imu": 300, "position": 30, "velocity": 60, "reference": 60} | left
    shared = np.isin(np.round(recording.imu.t_s, 6), np.round(sound.imu.t_s, 6))
    assert shared.mean() > 0.9
    assert np.abs(recording.imu.accel_mps2 - [0, 0, 9.81]).max() < 0.1
    assert np.abs(recording.position.enu_m[:, :2]).max() < 5.0
    assert np.abs(recording.position.enu_m[:, 2]).max() < 1e-3
    assert np.linalg.norm(recording.velocity.mps, axis=1).max() < 1.1


@pytest.mark.parametrize("harm", [zero_covariance, nan_covariance, indefinite_covariance])
def test_a_bad_covariance_is_replaced(tmp_path, harm):
    drive = Drive(duration_s=6.0)
    harm(drive)
    repaired = load(drive, tmp_path)
    np.testing.assert_allclose(repaired.position.covariance_m2[3], np.diag([1e-4, 4e-4, 9e-4]))
    given = fixposition(str(tmp_path / "a.bag"), position_sigma_m=(1.0, 2.0, 3.0)).load(0)
    np.testing.assert_allclose(given.position.covariance_m2[3], np.diag([4.0, 1.0, 9.0]))  # in the stated order


def test_what_leaves_nothing_is_a_sentence_that_says_which_parameter_helps(tmp_path):
    drive = Drive(duration_s=6.0)
    for message in drive.messages(FIX):
        message.position_covariance[:] = 0.0
    with pytest.raises(RecordingError, match="position_sigma_m"):
        load(drive, tmp_path)
    given = fixposition(str(tmp_path / "a.bag"), position_sigma_m=(1.0, 1.0, 1.0)).load(0)
    assert len(given.position.t_s) == 30
    drive = Drive(duration_s=6.0)
    for message in drive.messages(IMU):
        message.angular_velocity.x = message.angular_velocity.y = message.angular_velocity.z = 0.0
    with pytest.raises(RecordingError, match=r"0 usable .* frozen"):
        load(drive, tmp_path)


def test_a_clock_that_runs_otherwise_is_kept_and_said(tmp_path):
    drive = Drive(duration_s=6.0)
    for k, row in enumerate(drive.rows[IMU]):
        row[0] += k * 10**8  # recorded while playing at a fifth of the speed
    recording = load(drive, tmp_path)
    assert len(recording.imu.t_s) == 300
    assert any("(different clock)" in note for note in recording.notes)
