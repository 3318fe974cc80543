import numpy as np

from jerkbench.disturbances.outages import GnssOutage
from jerkbench.recording import Heading, Velocity


def test_begin_is_inside_and_end_is_not(recording):
    done = GnssOutage(windows_s=((40.0, 50.0), (102.0, 112.0))).apply(recording, 0)
    expected = [t for t in recording.position.t_s if not (40 <= t < 50 or 102 <= t < 112)]
    assert done.position.t_s.tolist() == done.velocity.t_s.tolist() == expected
    assert 50.0 in done.position.t_s
    np.testing.assert_array_equal(done.position.enu_m[:, 0], expected)
    assert done.outages_s.tolist() == [[40, 50], [102, 112]]
    assert done.reference is recording.reference
    assert done.heading is recording.heading


def test_the_heading_goes_when_asked(recording):
    done = GnssOutage(heading=True).apply(recording, 0)
    assert done.heading.t_s.tolist() == done.position.t_s.tolist()


def test_a_wheel_and_odometry_stay_and_a_receivers_course_goes(make):
    t_s = make().heading.t_s
    zeros, sigma = np.zeros(len(t_s)), np.full(len(t_s), 0.01)
    driven = make(velocity=Velocity.along_course(t_s, zeros, 0.1), heading=Heading(t_s, zeros, sigma, "odometry"))
    done = GnssOutage(heading=True).apply(driven, 0)
    assert done.velocity is driven.velocity
    assert done.heading is driven.heading
    course = GnssOutage().apply(make(heading=Heading(t_s, zeros, sigma, "course")), 0)
    assert course.heading.t_s.tolist() == course.position.t_s.tolist()


def test_outages_add_up_and_windows_outside_are_left_out(recording):
    first = GnssOutage(windows_s=((-9.0, -1.0), (10.0, 20.0), (200.0, 210.0))).apply(recording, 0)
    second = GnssOutage(windows_s=((115.0, 130.0),)).apply(first, 0)
    assert second.outages_s.tolist() == [[10, 20], [115, 120]]


def test_regular_windows_replace_the_given_ones(recording):
    done = GnssOutage(count=3, length_s=5.0, first_s=20.0, every_s=30.0).apply(recording, 0)
    assert done.outages_s.tolist() == [[20, 25], [50, 55], [80, 85]]
