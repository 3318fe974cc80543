"""Recordings in which something is wrong with the messages: each ends in its sentence or entry of the report."""

import numpy as np
import pytest

from bag_maker import Drive
from jerkbench.datasets.rosbag import Fixposition
from jerkbench.errors import RecordingError

IMU, FIX, ODOMETRY = "/fixposition/poiimu", "/fixposition/gnss1", "/fixposition/odometry_ecef"
YEAR_1980 = 315_964_800


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """What the drive is when nothing is wrong with it."""
    return load(Drive(duration_s=6.0), tmp_path_factory.mktemp("sound"))


def load(drive, folder, **options):
    return Fixposition(str(drive.write(folder / "a.bag")), **options).load(0)


def set_stamp(message, ns):
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def shift(messages, seconds):
    for message in messages:
        set_stamp(message, stamp_ns(message) + round(seconds * 1e9))


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


def late(drive):
    shift(drive.messages(IMU)[120:122], -0.05)


def set_back(drive):
    shift(drive.messages(IMU)[200:205], -3.0)


def in_the_future(drive):
    shift(drive.messages(IMU)[150:151], 2.0**31 / 16)  # one flipped bit


def frozen_in_the_middle(drive):
    for message in drive.messages(IMU)[100:120]:
        message.angular_velocity = drive.messages(IMU)[100].angular_velocity


def nan_accel(drive):
    drive.messages(IMU)[7].linear_acceleration.x = float("nan")


def infinite_gyro(drive):
    drive.messages(IMU)[7].angular_velocity.z = float("inf")


def huge_accel(drive):
    drive.messages(IMU)[7].linear_acceleration.x = 1e300


def huge_gyro(drive):
    drive.messages(IMU)[7].angular_velocity.x = -4e5


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


def nan_latitude(drive):
    drive.messages(FIX)[4].latitude = float("nan")


def impossible_latitude(drive):
    drive.messages(FIX)[4].latitude = 212.0


def impossible_height(drive):
    drive.messages(FIX)[4].altitude = -1e7


def leap(drive):
    drive.messages(FIX)[8].longitude += 0.01  # 1.1 km


def first_leaps(drive):
    drive.messages(FIX)[0].longitude += 0.01


def float_jump(drive):
    for message in drive.messages(FIX)[15:20]:
        message.status.status = 0
        message.altitude += 8.0
        message.position_covariance[:] = np.diag([0.25, 0.25, 0.25]).ravel()


def zero_covariance(drive):
    for message in drive.messages(FIX)[3:8]:
        message.position_covariance[:] = 0.0


def nan_covariance(drive):
    drive.messages(FIX)[3].position_covariance[4] = float("nan")


def indefinite_covariance(drive):
    drive.messages(FIX)[3].position_covariance[:] = [1, 2, 0, 2, 1, 0, 0, 0, 1]


def skew_covariance(drive):
    drive.messages(FIX)[3].position_covariance[1] = 3e-4


def huge_covariance(drive):
    drive.messages(FIX)[3].position_covariance[:] = 1e300 * np.eye(3).ravel()


def zero_quaternion(drive):
    q = drive.messages(ODOMETRY)[5].pose.pose.orientation
    q.x = q.y = q.z = q.w = 0.0


def long_quaternion(drive):
    drive.messages(ODOMETRY)[5].pose.pose.orientation.w *= 1e3


def off_the_earth(drive):
    drive.messages(ODOMETRY)[5].pose.pose.position.x *= 2


def nan_position(drive):
    drive.messages(ODOMETRY)[5].pose.pose.position.y = float("nan")


def huge_speed(drive):
    drive.messages(ODOMETRY)[5].twist.twist.linear.x = 3e8


def zero_twist_covariance(drive):
    drive.messages(ODOMETRY)[5].twist.covariance[:] = 0.0


KEPT = [  # what is done, what the report says, and how many rows of which stream are left of 300, 30, 60
    (everything_in_1980, "300 of 300 rows with a stamp before 2017-01-01", {}),
    (zero_stamps, "10 of 300 rows with a stamp before 2017-01-01", {}),
    (repeated, "5 of 300 rows with the stamp of the row before", {"imu": 295}),
    (late, "2 of 300 rows with a stamp older than an earlier row's, the first 2.40 s into the bag: sorted in", {}),
    (set_back, "5 of 300 rows with a stamp that was set back by seconds", {"imu": 295}),
    (in_the_future, "1 of 300 rows with a stamp far from the time of recording", {"imu": 299}),
    (frozen_in_the_middle, "19 of 300 rows with a frozen angular rate", {"imu": 281}),
    (nan_accel, "1 of 300 rows with a NaN or infinite linear acceleration", {"imu": 299}),
    (infinite_gyro, "1 of 300 rows with a NaN or infinite angular velocity", {"imu": 299}),
    (huge_accel, "1 of 300 rows with an impossible linear acceleration, above 1000", {"imu": 299}),
    (huge_gyro, "1 of 300 rows with an impossible angular velocity, above 100", {"imu": 299}),
    (lost_samples, "1 of 250 rows with a gap before them, up to 1.02 s", {"imu": 250}),
    (lost_fixes, "1 of 25 rows with a gap before them, up to 1.20 s", {"position": 25}),
    (no_status, "3 of 30 rows with status -1 (no fix)", {"position": 27}),
    (zero_coordinates, "1 of 30 rows with coordinates that are NaN, zero or not on Earth", {"position": 29}),
    (nan_latitude, "1 of 30 rows with coordinates that are NaN, zero or not on Earth", {"position": 29}),
    (impossible_latitude, "1 of 30 rows with coordinates that are NaN, zero or not on Earth", {"position": 29}),
    (impossible_height, "1 of 30 rows with coordinates that are NaN, zero or not on Earth", {"position": 29}),
    (leap, "1 of 30 rows with a position that leaps out of its neighbours", {"position": 29}),
    (first_leaps, "1 of 30 rows with a position that leaps out of its neighbours", {"position": 29}),
    (float_jump, "2 of 30 rows with a jump at a change of the kind of fix", {}),
    (zero_covariance, "5 of 30 rows with a position covariance that is zero, NaN or not positive definite", {}),
    (nan_covariance, "1 of 30 rows with a position covariance that is zero, NaN or not positive definite", {}),
    (indefinite_covariance, "1 of 30 rows with a position covariance that is zero, NaN or not positive definite", {}),
    (skew_covariance, "1 of 30 rows with a position covariance that is zero, NaN or not positive definite", {}),
    (huge_covariance, "1 of 30 rows with a position covariance that is zero, NaN or not positive definite", {}),
    (zero_quaternion, "1 of 60 rows with an orientation that is no unit quaternion", {"velocity": 59, "reference": 59}),
    (long_quaternion, "1 of 60 rows with an orientation that is no unit quaternion", {"velocity": 59, "reference": 59}),
    (off_the_earth, "1 of 60 rows with an ECEF position that is not on Earth", {"velocity": 59, "reference": 59}),
    (nan_position, "1 of 60 rows with a NaN or infinite position", {"velocity": 59, "reference": 59}),
    (huge_speed, "1 of 60 rows with an impossible linear velocity, above 200", {"velocity": 59, "reference": 59}),
    (zero_twist_covariance, "1 of 60 rows with a velocity covariance that is zero, NaN or not positive definite", {}),
]


@pytest.mark.parametrize(("harm", "said", "left"), KEPT, ids=lambda one: getattr(one, "__name__", ""))
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
    height = recording.position.enu_m[:, 2]
    assert np.abs(recording.position.enu_m[:, :2] - [0, 0]).max() < 5.0
    assert np.abs(height - (0 if harm is not float_jump else height)).max() < 1e-3
    assert np.linalg.norm(recording.velocity.mps, axis=1).max() < 1.1


@pytest.mark.parametrize("harm", [harm for harm, *_ in KEPT[::4]])
def test_in_the_mode_refuse_trouble_is_an_error(tmp_path, harm):
    drive = Drive(duration_s=6.0)
    harm(drive)
    with pytest.raises(RecordingError, match="choose sanitise=repair or sanitise=drop"):
        load(drive, tmp_path, sanitise="refuse")


@pytest.mark.parametrize("harm", [zero_covariance, nan_covariance, indefinite_covariance])
def test_a_bad_covariance_is_replaced_or_dropped_by_mode(tmp_path, harm):
    drive = Drive(duration_s=6.0)
    harm(drive)
    repaired = load(drive, tmp_path)
    np.testing.assert_allclose(repaired.position.covariance_m2[3], np.diag([1e-4, 4e-4, 9e-4]))
    given = Fixposition(str(tmp_path / "a.bag"), position_sigma_m=(1.0, 2.0, 3.0)).load(0)
    np.testing.assert_allclose(given.position.covariance_m2[3], np.diag([4.0, 1.0, 9.0]))  # in the stated order
    dropped = Fixposition(str(tmp_path / "a.bag"), sanitise="drop").load(0)
    assert len(dropped.position.t_s) == 30 - (5 if harm is zero_covariance else 1)


def test_no_covariance_at_all_says_which_parameter_gives_one(tmp_path):
    drive = Drive(duration_s=6.0)
    for message in drive.messages(FIX):
        message.position_covariance[:] = 0.0
    with pytest.raises(RecordingError, match="position_sigma_m"):
        load(drive, tmp_path)
    given = Fixposition(str(tmp_path / "a.bag"), sanitise="drop", position_sigma_m=(1.0, 1.0, 1.0)).load(0)
    assert len(given.position.t_s) == 30


def test_a_gyro_that_is_frozen_throughout_leaves_nothing(tmp_path):
    drive = Drive(duration_s=6.0)
    for message in drive.messages(IMU):
        message.angular_velocity.x = message.angular_velocity.y = message.angular_velocity.z = 0.0
    with pytest.raises(RecordingError, match=r"0 usable .* frozen"):
        load(drive, tmp_path)


def test_a_recording_that_is_sound_is_not_refused(tmp_path, sound):
    recording = load(Drive(duration_s=6.0), tmp_path, sanitise="refuse")
    np.testing.assert_array_equal(recording.imu.accel_mps2, sound.imu.accel_mps2)


def test_a_clock_that_runs_otherwise_is_kept_and_said(tmp_path):
    drive = Drive(duration_s=6.0)
    for k, row in enumerate(drive.rows[IMU]):
        row[0] += k * 10**8  # recorded while playing at a fifth of the speed
    recording = load(drive, tmp_path)
    assert len(recording.imu.t_s) == 300
    assert any("whose clock ran otherwise" in note for note in recording.notes)
