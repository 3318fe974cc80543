"""The start of the attitude filters, and the checks of their parameters."""

from dataclasses import replace

import numpy as np
import pytest
from moved import G, degrees_between, recording
from scipy.spatial.transform import Rotation

from jerkbench.attitude.common import tilt_start
from jerkbench.attitude.mahony import Madgwick
from jerkbench.attitude.reference import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.vqf import Vqf
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import create
from jerkbench.recording import Position, Velocity


def driving(aiding="velocity"):
    """An accelerated drive in a banked curve (12 s, 100 Hz, no rest), and the true x before the first sample."""
    t = np.arange(1201) / 100
    yaw, speed = 0.3 + 0.2 * t, 8.0 + 1.5 * t
    enu_m = np.cumsum(np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), 0 * t]), axis=0) / 100
    velocity = np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), 0 * t])
    turn = Rotation.from_euler("ZYX", np.column_stack([yaw, 0 * t + 0.05, 0.08 + 0.02 * np.sin(t)]))
    gyro = (turn[:-1].inv() * turn[1:]).as_rotvec() * 100
    force = turn[1:].inv().apply(np.diff(velocity, axis=0) * 100 + [0.0, 0.0, G])
    at = np.arange(0, 1200, 20)
    streams = {
        "velocity": {"velocity": Velocity(t[1:][at], velocity[1:][at], np.tile(0.01 * np.eye(3), (len(at), 1, 1)))},
        "position": {"position": Position(t[1:][at], enu_m[1:][at], np.tile(np.eye(3), (len(at), 1, 1)))},
        "none": {},
    }[aiding]
    return recording(gyro, force, **streams), turn[1].inv().apply([0.0, 0.0, 1.0])


def test_the_track_determines_the_vertical_of_a_drive_that_starts_in_a_curve():
    drive, truth = driving()
    off = {
        way: float(degrees_between(tilt_start(drive, alignment=way).x, truth)) for way in ("gravity", "rest", "track")
    }
    assert off["track"] < 0.1
    assert off["rest"] > 4.0
    assert off["gravity"] > 4.0
    assert tilt_start(drive, alignment="track").variance == 1e-3
    assert tilt_start(drive, alignment="gravity").variance == 0.03
    drive, truth = driving("position")
    assert degrees_between(tilt_start(drive, alignment="track").x, truth) < 0.3
    drive, truth = driving()
    noisy = drive.velocity.mps + 0.1 * np.random.default_rng(0).normal(size=drive.velocity.mps.shape)
    drive = replace(drive, velocity=Velocity(drive.velocity.t_s, noisy, drive.velocity.covariance_m2ps2))
    assert degrees_between(tilt_start(drive, alignment="track").x, truth) < 0.5


@pytest.mark.parametrize("plugin", [Tilt, GyroOnly, Madgwick])
def test_every_filter_starts_with_the_alignment(plugin):
    drive, truth = driving()
    first = {way: plugin(alignment=way).verticals(drive)[0][0] for way in ("rest", "track")}
    assert degrees_between(first["track"], truth) < 1.5
    assert degrees_between(first["rest"], truth) > 2.0


def test_a_start_in_motion_has_a_note_if_there_are_velocities():
    drive, _ = driving()
    (said,) = Tilt(yaw_source="gyro_only").remarks(drive)
    assert "begins in motion, and the tilt starts level" in said
    assert "the specific force of the first second" in Vqf(yaw_source="gyro_only").remarks(drive)[0]
    for plugin, known in (
        (Tilt(alignment="track", yaw_source="gyro_only"), drive),
        (Tilt(yaw_source="gyro_only"), replace(drive, static_start_s=1.5)),
        (Tilt(yaw_source="gyro_only"), driving("position")[0]),
    ):
        assert plugin.remarks(known) == ()


def test_without_a_track_it_is_refused_before_a_sweep():
    drive, _ = driving("none")
    with pytest.raises(RecordingError, match="fewer than three velocities over ground"):
        Tilt(alignment="track").require(lambda: drive)
    Tilt().require(lambda: drive)


def test_at_rest_gravity_and_rest_are_the_same():
    still = recording(np.zeros((300, 3)), np.tile([0.5, 0.0, G], (300, 1)), 2.0)
    one, other = (tilt_start(still, alignment=way) for way in ("rest", "gravity"))
    np.testing.assert_array_equal(one.x, other.x)
    assert one.variance == other.variance == 1e-3


WRONG = {
    "tilt": [
        ({"adapt": "mft"}, "no adapt of attitude tilt 'mft'. Did you mean 'mtf'"),
        ({"sigma_accel_mps2": 0.0}, "sigma_accel_mps2 is 0.0; it must be a positive number"),
        ({"course_min_speed_mps": 0.0}, "course_min_speed_mps is 0.0"),
        ({"external_memory": 1.5}, "external_memory is 1.5; it must be from 0 to 1"),
        ({"window": 0}, "window is 0; it must be at least 1"),
        ({"adapt": "lee"}, "adapt=lee has no effect with external_memory=0"),
    ],
    "gyro_only": [
        ({"course_min_speed_mps": 0.0}, "course_min_speed_mps is 0.0"),
    ],
    "mekf": [
        ({"accel_density": 0.0}, r"accel_density is 0\.0; it must be a positive number"),
        ({"external_memory": 1.0}, r"external_memory is 1\.0; it must be between 0 and 1"),
        ({"window_s": 0.0}, r"window_s is 0\.0"),
    ],
    "vqf": [({"tau_acc_s": 0.0}, r"attitude vqf: tau_acc_s is 0\.0")],
    "offline_vqf": [({"alignment": "rest"}, "offline_vqf: alignment is rest")],
    "reference": [({"gap_s": 0.0}, "gap_s is 0")],
}


@pytest.mark.parametrize(("name", "wrong", "reason"), [(name, *each) for name, all_ in WRONG.items() for each in all_])
def test_an_invalid_value_raises(name, wrong, reason):
    with pytest.raises(PluginError, match=reason):
        create("attitude", {"name": name, **wrong})
