import numpy as np
import pytest

from jerkbench.disturbances.outages import GnssOutage, OutageSweep, PositionOutage, VelocityOutage
from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Velocity

OUTAGES = [
    (GnssOutage, ("position", "velocity"), ("heading",)),
    (PositionOutage, ("position",), ("velocity", "heading")),
    (VelocityOutage, ("velocity",), ("position", "heading")),
]


@pytest.mark.parametrize(("plugin", "removed", "stays"), OUTAGES)
def test_windows_include_their_start_but_not_their_end_and_affect_no_other_stream(recording, plugin, removed, stays):
    done = plugin(windows_s=((-9.0, -1.0), (40.0, 50.0), (115.0, 300.0), (400.0, 410.0))).apply(recording, 0)
    rows = [k for k, t in enumerate(recording.position.t_s) if not (40 <= t < 50 or 115 <= t < 120)]
    for name in removed:
        before, after = getattr(recording, name), getattr(done, name)
        np.testing.assert_array_equal(after.t_s, before.t_s[rows])

    if "position" in removed:
        np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[rows])
    assert all(getattr(done, name) is getattr(recording, name) for name in (*stays, "imu", "reference"))
    assert done.outages_s.tolist() == [[40, 50], [115, 120]]


def test_a_wheel_and_odometry_are_not_removed_but_headings_of_the_receiver_are(make, recording):
    t_s = recording.heading.t_s
    zeros, sigma = np.zeros(len(t_s)), np.full(len(t_s), 0.01)
    driven = make(velocity=Velocity.along_course(t_s, zeros, 0.1), heading=Heading(t_s, zeros, sigma, "odometry"))
    done = GnssOutage(heading=True).apply(driven, 0)
    assert done.velocity is driven.velocity
    assert done.heading is driven.heading
    course = GnssOutage().apply(make(heading=Heading(t_s, zeros, sigma, "course")), 0)
    with_heading = GnssOutage(heading=True).apply(recording, 0)
    for one in (course, with_heading):
        assert one.heading.t_s.tolist() == one.position.t_s.tolist()


def test_outages_add_up_and_regular_windows_replace_the_given_ones(recording):
    first = GnssOutage(windows_s=((10.0, 20.0),)).apply(recording, 0)
    second = GnssOutage(windows_s=((115.0, 130.0),)).apply(first, 0)
    assert second.outages_s.tolist() == [[10, 20], [115, 120]]
    regular = GnssOutage(count=3, length_s=5.0, first_s=20.0, every_s=30.0).apply(recording, 0)
    assert regular.outages_s.tolist() == [[20, 25], [50, 55], [80, 85]]


def test_the_outages_of_the_sweep_start_everywhere_and_do_not_overlap(make):
    recording = make(duration_s=150.0)
    plugin = OutageSweep(length_s=5.0)
    begins = []
    for seed in range(plugin.replicates()):
        done = plugin.apply(recording, seed)
        np.testing.assert_allclose(np.diff(done.outages_s, axis=1), 5.0)
        assert (done.outages_s[1:, 0] - done.outages_s[:-1, 1]).min(initial=99.0) >= 50
        missing = np.setdiff1d(recording.position.t_s, done.position.t_s)
        assert len(missing) == 20 * len(done.outages_s)  # 5 s at 4 Hz, all complete
        begins += done.outages_s[:, 0].tolist()
    assert sorted(begins) == [20 + 10.0 * k for k in range(13)]


@pytest.mark.parametrize(("length_s", "last"), [(2.0, 140.0), (10.0, 140.0), (20.0, 130.0), (30.0, 120.0)])
def test_the_starts_do_not_depend_on_the_length_except_at_the_end(make, length_s, last):
    plugin = OutageSweep(length_s=length_s)
    windows = np.concatenate([plugin.apply(make(duration_s=150.0), seed).outages_s for seed in range(6)])
    assert sorted(windows[:, 0]) == [20 + 10.0 * k for k in range(round((last - 20) / 10) + 1)]
    np.testing.assert_allclose(windows[:, 1] - windows[:, 0], length_s)


def test_the_heading_is_removed_on_request_a_given_phase_is_used_and_a_short_recording_raises(recording, make):
    done = OutageSweep(phase=1, heading=True).apply(recording, 5)
    assert done.outages_s.tolist() == [[30, 40], [90, 100]]
    assert done.heading.t_s.tolist() == done.position.t_s.tolist()
    assert OutageSweep(phase=1).replicates() == 1
    with pytest.raises(RecordingError, match=r"25\.0 s.* 10\.0 s"):
        OutageSweep().apply(make(duration_s=25.0), 0)
