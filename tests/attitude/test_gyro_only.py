import dataclasses

import moved
import numpy as np
import pytest
from moved import G, standing
from scipy.spatial.transform import Rotation

from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Imu


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


def test_no_acceleration_after_the_alignment_reaches_the_angles():
    gyro = np.random.default_rng(2).normal(size=(400, 3)) * 0.1
    calm = recording(gyro)
    accel = calm.imu.accel_mps2.copy()
    accel[150:] += 7.0
    shaken = dataclasses.replace(calm, imu=Imu(calm.imu.t_s, accel, gyro))
    one, other = (GyroOnly().estimate(r) for r in (calm, shaken))
    np.testing.assert_array_equal(one.euler_rad, other.euler_rad)
    assert (one.accel_enu_mps2[200:] != other.accel_enu_mps2[200:]).all()
    assert not other.triggered.any()


def test_a_bias_tilts_it_by_its_integral():
    attitude = GyroOnly().estimate(recording(np.tile([0.002, 0.0, 0.0], (1000, 1))))
    np.testing.assert_allclose(attitude.euler_rad[[99, 999], 0], [0.002, 0.02], atol=1e-12)
    np.testing.assert_allclose(attitude.accel_enu_mps2[999, 1], -G * np.sin(0.02), atol=1e-3)


def test_yaw_is_that_of_the_tilt_filter():
    gyro = np.tile([0.0, 0.0, 0.5], (300, 1))
    heading = Heading([0.1, 1.0, 2.0], [2.0, 2.4, 3.0], [0.01, 0.01, 0.01])
    drive = recording(gyro, heading=heading)
    for source in ("auto", "dual_antenna", "gyro_only"):
        ours, theirs = (p(yaw_source=source).estimate(drive).euler_rad[:, 2] for p in (GyroOnly, Tilt))
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_a_heading_that_is_not_there_is_one_sentence():
    with pytest.raises(RecordingError, match="no dual-antenna heading"):
        GyroOnly(yaw_source="dual_antenna").estimate(recording(np.zeros((300, 3))))


def test_on_the_field_without_noise_it_stays_with_the_truth():
    """The gyro is exact there; what is left is the alignment's tilt error and the yaw's walk."""
    drive = FieldWhite(duration_s=40.0, noise=False).load(0)
    attitude = GyroOnly().estimate(drive)
    np.testing.assert_allclose(attitude.euler_rad[:, :2], drive.reference.euler_rad[:, :2], atol=2e-6)
    first = drive.imu.accel_mps2[1:500]
    assert np.abs(first).max() < 40
    u = np.diff(drive.reference.velocity_mps, axis=0) / 0.01
    np.testing.assert_allclose(attitude.accel_enu_mps2[1:, 2], u[:, 2], atol=1e-4)
