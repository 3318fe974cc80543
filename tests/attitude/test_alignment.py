"""The start of the attitude filters."""

from dataclasses import replace

import numpy as np
import pytest
from moved import G, degrees_between, recording
from scipy.spatial.transform import Rotation

from jerkbench.attitude.common import tilt_start
from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.madgwick import Madgwick
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.vqf import Vqf
from jerkbench.errors import RecordingError
from jerkbench.recording import Position, Velocity


def driving(aiding="velocity"):
    """A banked curve that becomes faster: 12 s at 100 Hz, no rest; the drive and the true x before the first sample."""
    t = np.arange(1201) / 100
    yaw, speed = 0.3 + 0.2 * t, 8.0 + 1.5 * t
    place = np.cumsum(np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), 0 * t]), axis=0) / 100
    velocity = np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), 0 * t])
    turn = Rotation.from_euler("ZYX", np.column_stack([yaw, 0 * t + 0.05, 0.08 + 0.02 * np.sin(t)]))
    gyro = (turn[:-1].inv() * turn[1:]).as_rotvec() * 100
    force = turn[1:].inv().apply(np.diff(velocity, axis=0) * 100 + [0.0, 0.0, G])
    at = np.arange(0, 1200, 20)
    own = {
        "velocity": {"velocity": Velocity(t[1:][at], velocity[1:][at], np.tile(0.01 * np.eye(3), (len(at), 1, 1)))},
        "position": {"position": Position(t[1:][at], place[1:][at], np.tile(np.eye(3), (len(at), 1, 1)))},
        "none": {},
    }[aiding]
    return recording(gyro, force, **own), turn[1].inv().apply([0.0, 0.0, 1.0])


def test_the_track_shows_the_vertical_of_a_drive_that_begins_in_a_curve():
    drive, truth = driving()
    off = {
        way: float(degrees_between(tilt_start(drive, alignment=way).x, truth)) for way in ("gravity", "rest", "track")
    }
    assert off["track"] < 0.1
    assert off["rest"] > 4.0
    assert off["gravity"] > 4.0
    assert tilt_start(drive, alignment="track").variance == 1e-3
    assert tilt_start(drive, alignment="gravity").variance == 0.03


def test_fixes_stand_in_for_velocities():
    drive, truth = driving("position")
    assert degrees_between(tilt_start(drive, alignment="track").x, truth) < 0.3


def test_noise_of_the_velocities_hardly_counts():
    drive, truth = driving()
    noisy = drive.velocity.mps + 0.1 * np.random.default_rng(0).normal(size=drive.velocity.mps.shape)
    drive = replace(drive, velocity=Velocity(drive.velocity.t_s, noisy, drive.velocity.covariance_m2ps2))
    assert degrees_between(tilt_start(drive, alignment="track").x, truth) < 0.5


@pytest.mark.parametrize("plugin", [Tilt, GyroOnly, Madgwick])
def test_every_filter_starts_there(plugin):
    drive, truth = driving()
    first = {way: plugin(alignment=way).verticals(drive)[0][0] for way in ("rest", "track")}
    assert degrees_between(first["track"], truth) < 1.5
    assert degrees_between(first["rest"], truth) > 2.0


def test_a_start_in_motion_is_said_where_a_velocity_would_show_it():
    drive, _ = driving()
    (said,) = Tilt(yaw_source="gyro_only").remarks(drive)
    assert "begins in motion, and the tilt starts level" in said
    assert "first second's specific force" in Vqf(yaw_source="gyro_only").remarks(drive)[0]
    for plugin, known in (
        (Tilt(alignment="track", yaw_source="gyro_only"), drive),
        (Tilt(yaw_source="gyro_only"), replace(drive, static_start_s=1.5)),
        (Tilt(yaw_source="gyro_only"), driving("position")[0]),
    ):
        assert plugin.remarks(known) == ()


def test_without_a_track_it_is_refused_before_a_sweep():
    drive, _ = driving("none")
    with pytest.raises(RecordingError, match="fewer than three velocities over ground, or fixes"):
        Tilt(alignment="track").require(lambda: drive)
    Tilt().require(lambda: drive)


def test_at_rest_gravity_and_rest_are_the_same():
    still = recording(np.zeros((300, 3)), np.tile([0.5, 0.0, G], (300, 1)), 2.0)
    one, other = (tilt_start(still, alignment=way) for way in ("rest", "gravity"))
    np.testing.assert_array_equal(one.x, other.x)
    assert one.variance == other.variance == 1e-3
