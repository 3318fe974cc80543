import math

import numpy as np
import pytest

from jerkbench.attitude.yaw import course_headings, select_headings
from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Imu, Recording, Reference, Velocity

IMU = Imu([0.0, 1.0], [[0, 0, 9.81]] * 2, np.zeros((2, 3)))
HEADING = Heading([0.5], [1.0], [0.01])
FAST = Velocity([0.5], [[3.0, 4.0, 0.0]], [np.eye(3)])
ODOMETRY = Heading([0.5], [1.2], [0.02], "odometry")
COURSE = Heading([0.5], [1.3], [0.02], "course")
SLOW = Velocity([0.5], [[0.3, 0.3, 2.0]], [np.eye(3)])
BODY = Velocity([0.5], [[5.0, 0.0, 0.0]], [np.eye(3)], frame="body")
SPEED = Velocity.along_course([0.5], [5.0], 0.5)


def recording(**parts):
    return Recording("farm", IMU, Reference([1.0], "nothing", independent=True), **parts)


def select(source, **parts):
    return select_headings(recording(**parts), source, 0.5, 0.0087)


def test_course_and_its_sigma():
    R = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 1.0]])
    headings = course_headings(Velocity([2.0], [[-3.0, 4.0, 9.0]], [R]), 0.5, 0.0087)
    assert headings.t_s.tolist() == [2.0]
    assert headings.yaw_rad[0] == pytest.approx(math.pi - math.atan(4 / 3))
    # across (-3, 4)/5 is (-4, -3)/5: (16 * .04 + 2 * 12 * .01 + 9 * .09)/25
    assert headings.sigma_rad[0] == pytest.approx(math.sqrt((0.64 + 0.24 + 0.81) / 25) / 5)


def test_course_leaves_out_what_is_slow_or_absent_and_keeps_the_least_sigma():
    nan = math.nan
    mps = [[0.5, 0.0, 0.0], [nan, 2.0, 0.0], [2.0, nan, 0.0], [2.0, 0.0, nan]]
    headings = course_headings(Velocity(np.arange(4.0), mps, [1e-8 * np.eye(3)] * 4), 0.5, 0.0087)
    assert headings.t_s.tolist() == [3.0]
    assert headings.sigma_rad.tolist() == [0.0087]


def test_auto_takes_the_dual_antenna_then_the_course_then_nothing():
    assert select("auto", heading=HEADING, velocity=FAST) is HEADING
    assert select("auto", velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("auto", heading=Heading([], [], []), velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("auto", heading=ODOMETRY, velocity=FAST) is ODOMETRY
    for velocity in (None, SLOW, BODY, SPEED):
        assert select("auto", velocity=velocity) is None


def test_a_source_that_is_asked_for_is_taken():
    assert select("gyro_only", heading=HEADING, velocity=FAST) is None
    assert select("dual_antenna", heading=HEADING, velocity=FAST) is HEADING
    assert select("course", heading=HEADING, velocity=FAST).yaw_rad[0] == pytest.approx(math.atan2(4, 3))
    assert select("odometry", heading=ODOMETRY, velocity=FAST) is ODOMETRY
    assert select("course", heading=COURSE, velocity=SPEED) is COURSE


@pytest.mark.parametrize(
    ("source", "velocity", "reason"),
    [
        ("dual_antenna", FAST, "farm has no dual-antenna heading; take"),
        ("odometry", FAST, "farm has no odometry heading; take"),
        ("course", None, "farm has no velocity, so no course; take"),
        ("course", SPEED, "farm has its velocity in the speed frame"),
        ("course", BODY, "farm has its velocity in the body frame"),
        ("course", SLOW, "farm is never faster than 0.5 m/s"),
    ],
)
def test_a_source_that_is_not_there_is_one_sentence(source, velocity, reason):
    with pytest.raises(RecordingError, match=reason):
        select(source, velocity=velocity)
