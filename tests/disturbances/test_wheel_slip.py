import dataclasses

import numpy as np
import pytest

from jerkbench.disturbances.imu import WheelSlip
from jerkbench.errors import RecordingError
from jerkbench.recording import Reference, Velocity

WINDOW = {"windows_s": ((20.0, 24.0),)}


def with_velocity(recording, mps, **parts):
    m = len(recording.position.t_s)
    velocity = Velocity(recording.position.t_s, np.tile(mps, (m, 1)), np.tile(np.eye(3) * 1e-3, (m, 1, 1)), **parts)
    return dataclasses.replace(recording, velocity=velocity)


def heading(recording, yaw_rad):
    reference = recording.reference
    euler = np.column_stack([np.full((len(reference.t_s), 2), 0.2), np.full(len(reference.t_s), yaw_rad)])
    return dataclasses.replace(recording, reference=dataclasses.replace(reference, euler_rad=euler))


def slipped(recording, **parameters):
    """The offset in the window; outside nothing may change."""
    done = WheelSlip(**(WINDOW | parameters)).apply(recording, 0).velocity
    t_s = done.t_s
    inside = (t_s >= 20) & (t_s < 24)
    offset = done.mps - recording.velocity.mps
    np.testing.assert_array_equal(np.nan_to_num(offset[~inside]), 0)
    np.testing.assert_array_equal(done.covariance_m2ps2, recording.velocity.covariance_m2ps2)
    growth = done.true_covariance_m2ps2 - done.covariance_m2ps2
    known = np.nan_to_num(offset)
    np.testing.assert_allclose(growth, [np.outer(o, o) for o in known], atol=1e-12)
    return offset[inside]


def test_thirty_percent_along_the_references_heading(recording):
    driven = heading(with_velocity(recording, [1.0, 0.0, 0.5]), np.pi / 3)
    along = 0.3 * np.cos(np.pi / 3) * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3), 0.0])
    np.testing.assert_allclose(slipped(driven), np.tile(along, (16, 1)), atol=1e-12)


def test_without_a_heading_along_its_own_course(recording):
    np.testing.assert_allclose(
        slipped(with_velocity(recording, [3.0, -4.0, 0.5])), np.tile([0.9, -1.2, 0], (16, 1)), atol=1e-12
    )


def test_where_the_reference_knows_no_yaw_the_course_serves(recording):
    driven = heading(with_velocity(recording, [2.0, 0.0, 0.0]), np.pi / 2)
    euler = driven.reference.euler_rad.copy()
    euler[recording.reference.t_s >= 22] = np.nan
    half = dataclasses.replace(driven, reference=dataclasses.replace(driven.reference, euler_rad=euler))
    offset = slipped(half)
    np.testing.assert_allclose(offset[:8], 0, atol=1e-12)  # it heads north and drives east
    np.testing.assert_allclose(offset[8:], np.tile([0.6, 0, 0], (8, 1)), atol=1e-12)


def test_the_yaw_of_the_nearest_stamp_is_taken(recording):
    reference = Reference([0.0, 21.9, 30.0], "r", independent=True, euler_rad=[[0, 0, 0], [0, 0, 0], [0, 0, np.pi / 2]])
    driven = dataclasses.replace(with_velocity(recording, [1.0, 1.0, 0.0]), reference=reference)
    offset = slipped(driven)
    np.testing.assert_allclose(offset, np.tile([0.3, 0, 0], (16, 1)), atol=1e-12)
    late = WheelSlip(windows_s=((27.0, 28.0),)).apply(driven, 0).velocity.mps - driven.velocity.mps
    np.testing.assert_allclose(late[27 * 4 : 28 * 4], np.tile([0, 0.3, 0], (4, 1)), atol=1e-12)


def test_a_wheels_speed_slips_where_it_is_there(recording):
    speed = Velocity.along_course(recording.position.t_s, np.full(len(recording.position.t_s), 2.0), 0.1)
    offset = slipped(dataclasses.replace(recording, velocity=speed), slip=-0.5)
    np.testing.assert_allclose(offset[:, 0], -1.0)
    assert np.isnan(offset[:, 1:]).all()


def test_a_body_velocity_slips_forwards(recording):
    np.testing.assert_allclose(
        slipped(with_velocity(recording, [2.0, 0.3, 0.1], frame="body"), slip=-0.5), np.tile([-1, 0, 0], (16, 1))
    )


def test_rows_without_east_and_north_stay(recording):
    driven = with_velocity(recording, [2.0, 1.0, 0.5])
    mps = driven.velocity.mps.copy()
    mps[::2, 0] = np.nan
    mps[1::2, 2] = np.nan
    mixed = dataclasses.replace(driven, velocity=dataclasses.replace(driven.velocity, mps=mps))
    offset = slipped(mixed)
    np.testing.assert_array_equal(offset[::2, 1:], 0)
    np.testing.assert_allclose(offset[1::2, :2], np.tile([0.6, 0.3], (8, 1)), atol=1e-12)
    mps[:, 0] = np.nan
    only_north = dataclasses.replace(driven, velocity=dataclasses.replace(driven.velocity, mps=mps))
    with pytest.raises(RecordingError, match="east and north at one time"):
        WheelSlip().apply(only_north, 0)


def test_no_velocity_is_a_sentence(make):
    with pytest.raises(RecordingError, match="made has no velocity, so no wheel can slip"):
        WheelSlip().apply(make(velocity=None), 0)
