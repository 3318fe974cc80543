"""Attitudes that use no accelerometer update: those of the reference, and the integrated gyro."""

import dataclasses

import moved
import numpy as np
import pytest
from moved import standing
from scipy.spatial.transform import Rotation

from jerkbench import plugins
from jerkbench.attitude.reference import GyroOnly, ReferenceAttitude
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Imu, Recording, Reference
from synthetic import recording_at_rest


def test_on_the_field_attitude_and_acceleration_are_true():
    drive = FieldWhite(duration_s=30.0, noise=False).load(0)
    attitude = plugins.create("attitude", {"name": "reference"}).estimate(drive)
    np.testing.assert_array_equal(attitude.euler_rad, drive.reference.euler_rad)
    u = np.diff(drive.reference.velocity_mps, axis=0) / 0.01
    np.testing.assert_allclose(attitude.accel_enu_mps2[1:], u, atol=1e-9)
    assert not attitude.triggered.any()


def made(t_s, euler, imu_t_s=(0.0, 0.05, 0.1, 0.15)):
    n = len(imu_t_s)
    imu = Imu(imu_t_s, np.tile([0.0, 0.0, 9.81], (n, 1)), np.zeros((n, 3)))
    return Recording("farm", imu, Reference(t_s, "made up", independent=True, euler_rad=euler))


def test_the_nearest_stamp_is_used_and_rows_with_a_nan_are_ignored():
    euler = np.array([[0.1, 0, 0], [0.2, np.nan, 0], [0.3, 0, 0]])
    attitude = ReferenceAttitude().estimate(made([0.0, 0.06, 0.12], euler))
    np.testing.assert_array_equal(attitude.euler_rad[:, 0], [0.1, 0.1, 0.3, 0.3])


@pytest.mark.parametrize("stamp_s", [0.2, -0.1])
def test_one_stamp_is_used_for_all_samples_within_the_gap(stamp_s):
    attitude = ReferenceAttitude(gap_s=0.3).estimate(made([stamp_s], np.zeros((1, 3))))
    assert attitude.euler_rad[:, 0].tolist() == [0.0] * 4


def test_endpoint_and_midpoint():
    euler = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    drive = made([0.0, 0.1], euler, (0.0, 0.1))
    end, middle = (
        ReferenceAttitude(compensation=c).estimate(drive).accel_enu_mps2[1] for c in ("endpoint", "midpoint")
    )
    np.testing.assert_allclose(end, [0, -9.81 * np.sin(1), 9.81 * (np.cos(1) - 1)], atol=1e-12)
    np.testing.assert_allclose(middle, end / 2, atol=1e-12)


@pytest.mark.parametrize(
    "refused", [ReferenceAttitude().estimate, lambda drive: ReferenceAttitude().require(lambda: drive)]
)
def test_no_attitude_and_a_gap_raise(refused):
    for drive in (recording_at_rest(1.0), made([0.0], np.full((1, 3), np.nan))):
        with pytest.raises(RecordingError, match=f"The reference of {drive.name} has no attitude"):
            refused(drive)
    with pytest.raises(RecordingError, match="Increase gap_s"):
        refused(made([0.0], np.zeros((1, 3))))
    ReferenceAttitude().require(lambda: FieldWhite(duration_s=5.0).load(0))


def recording(gyro, euler=(0.0, 0.0, 0.0), **parts):
    return moved.recording(gyro, standing(euler, len(gyro)), 2.0, **parts)


def test_tilt_is_the_composition_of_the_turns():
    """Against scipy: Omega_k = Omega_{k-1} Exp(dt w), with fast turns about all axes."""
    gyro = np.random.default_rng(1).normal(size=(300, 3)) * 5
    gyro[:100] = 0
    drive = recording(gyro, euler=(0.1, -0.2, 0.0))
    attitude = GyroOnly(yaw_source="gyro_only").estimate(drive)
    omega = Rotation.from_euler("ZYX", [0.0, -0.2, 0.1])
    for k in range(300):
        omega = omega * Rotation.from_rotvec(0.01 * gyro[k])
        if k % 50 == 0 or k == 299:
            np.testing.assert_allclose(attitude.dcm[k, 2], omega.as_matrix()[2], atol=1e-10)


def test_accelerations_after_the_alignment_have_no_effect():
    gyro = np.random.default_rng(2).normal(size=(400, 3)) * 0.1
    calm = recording(gyro)
    accel = calm.imu.accel_mps2.copy()
    accel[150:] += 7.0
    shaken = dataclasses.replace(calm, imu=Imu(calm.imu.t_s, accel, gyro))
    one, other = (GyroOnly().estimate(r) for r in (calm, shaken))
    np.testing.assert_array_equal(one.euler_rad, other.euler_rad)
    assert (one.accel_enu_mps2[200:] != other.accel_enu_mps2[200:]).all()
    assert not other.triggered.any()


def test_yaw_equals_the_yaw_of_the_tilt_filter():
    gyro = np.tile([0.0, 0.0, 0.5], (300, 1))
    heading = Heading([0.1, 1.0, 2.0], [2.0, 2.4, 3.0], [0.01, 0.01, 0.01])
    drive = recording(gyro, heading=heading)
    for source in ("auto", "dual_antenna", "gyro_only"):
        ours, theirs = (p(yaw_source=source).estimate(drive).euler_rad[:, 2] for p in (GyroOnly, Tilt))
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
