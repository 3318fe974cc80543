"""Recordings: the values they accept; and rotations."""

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Velocity

NAN = np.nan


def test_a_speed_alone_is_absent_across_or_zero_if_it_does_not_slide():
    speed = Velocity.along_course([1.0, 2.0], [3.0, NAN], 0.5)
    assert speed.frame == "speed"
    np.testing.assert_array_equal(speed.mps, [[3.0, NAN, NAN], [NAN, NAN, NAN]])
    assert speed.covariance_m2ps2[0, 0, 0] == 0.25
    speed = Velocity.along_course([1.0, 2.0], [3.0, NAN], 0.5, across_sigma_mps=0.1)
    np.testing.assert_array_equal(speed.mps, [[3.0, 0.0, 0.0], [NAN, NAN, NAN]])
    np.testing.assert_allclose(speed.covariance_m2ps2[0], np.diag([0.25, 0.01, 0.01]))


def test_an_absent_first_axis_and_unknown_frames_are_refused():
    with pytest.raises(RecordingError, match="row 1: a speed needs its first axis"):
        Velocity([1.0, 2.0], [[1.0, NAN, NAN], [NAN, 0.0, 0.0]], np.tile(np.eye(3), (2, 1, 1)), "speed")
    with pytest.raises(RecordingError, match="'wheel'"):
        Velocity([1.0], [[1.0, 0.0, 0.0]], [np.eye(3)], "wheel")
    with pytest.raises(RecordingError, match=r"'gps'.*dual_antenna"):
        Heading([1.0], [0.0], [0.1], "gps")
