import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Heading, Imu, Recording, Reference

G = 9.81


def recording(gyro, accel=None, euler=(0.0, 0.0, 0.0), **parts):
    n = len(gyro)
    rest = np.tile(dcm_from_euler(np.array(euler)).T @ [0.0, 0.0, G], (n, 1))
    imu = Imu(0.01 * np.arange(1, n + 1), rest if accel is None else accel, gyro)
    reference = Reference([0.01 * n], "made up", independent=True)
    return Recording("farm", imu, reference, **{"static_start_s": 2.0, **parts})


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


def test_on_the_field_without_noise_it_stays_with_the_truth():
    """The gyro is exact there; what is left is the alignment's tilt error and the yaw's walk."""
    drive = FieldWhite(duration_s=40.0, noise=False).load(0)
    attitude = GyroOnly().estimate(drive)
    np.testing.assert_allclose(attitude.euler_rad[:, :2], drive.reference.euler_rad[:, :2], atol=2e-6)
    first = drive.imu.accel_mps2[1:500]
    assert np.abs(first).max() < 40
    u = np.diff(drive.reference.velocity_mps, axis=0) / 0.01
    np.testing.assert_allclose(attitude.accel_enu_mps2[1:, 2], u[:, 2], atol=1e-4)


def test_what_makes_no_sense_is_one_sentence():
    for wrong, sentence in (
        ({"compensation": "mid"}, "no compensation of attitude gyro_only 'mid'"),
        ({"yaw_source": "compass"}, "no yaw_source of attitude gyro_only 'compass'"),
        ({"course_min_speed_mps": 0.0}, "course_min_speed_mps is 0.0"),
        ({"yaw_walk_rad_per_sqrt_s": -1.0}, "yaw_walk_rad_per_sqrt_s is -1.0"),
    ):
        with pytest.raises(PluginError, match=sentence):
            GyroOnly(**wrong)
    with pytest.raises(RecordingError, match="no dual-antenna heading"):
        GyroOnly(yaw_source="dual_antenna").estimate(recording(np.zeros((300, 3))))
