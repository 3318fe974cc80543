"""Recordings: their values, and the sentences that refuse others."""

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Velocity

NAN = np.nan


def test_a_speed_alone_leaves_the_axes_across_it_absent():
    speed = Velocity.along_course([1.0, 2.0], [3.0, NAN], 0.5)

    assert speed.frame == "speed"
    np.testing.assert_array_equal(speed.mps, [[3.0, NAN, NAN], [NAN, NAN, NAN]])
    assert speed.covariance_m2ps2[0, 0, 0] == 0.25


def test_a_speed_of_what_does_not_slide_is_zero_across():
    speed = Velocity.along_course([1.0, 2.0], [3.0, NAN], 0.5, across_sigma_mps=0.1)

    np.testing.assert_array_equal(speed.mps, [[3.0, 0.0, 0.0], [NAN, NAN, NAN]])
    np.testing.assert_allclose(speed.covariance_m2ps2[0], np.diag([0.25, 0.01, 0.01]))


def test_a_speed_may_be_absent_but_not_its_first_axis_alone():
    with pytest.raises(RecordingError, match="row 1: a speed needs its first axis"):
        Velocity([1.0, 2.0], [[1.0, NAN, NAN], [NAN, 0.0, 0.0]], np.tile(np.eye(3), (2, 1, 1)), "speed")


def test_frames_and_sources_are_known_ones():
    with pytest.raises(RecordingError, match="'wheel'"):
        Velocity([1.0], [[1.0, 0.0, 0.0]], [np.eye(3)], "wheel")
    with pytest.raises(RecordingError, match=r"'gps'.*dual_antenna"):
        Heading([1.0], [0.0], [0.1], "gps")
