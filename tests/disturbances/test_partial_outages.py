import numpy as np
import pytest

from jerkbench.disturbances.outages import GnssOutage, OutageSweep, PositionOutage, VelocityOutage
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.metrics.recovery import Outage
from jerkbench.recording import Heading, Reference, Velocity

OUTAGES = [
    (GnssOutage, ("position", "velocity"), ("heading",)),
    (PositionOutage, ("position",), ("velocity", "heading")),
    (VelocityOutage, ("velocity",), ("position", "heading")),
]


@pytest.mark.parametrize(("plugin", "gone", "stays"), OUTAGES)
def test_begin_is_inside_end_is_not_and_what_an_outage_does_not_concern_stays(recording, plugin, gone, stays):
    done = plugin(windows_s=((-9.0, -1.0), (40.0, 50.0), (115.0, 300.0), (400.0, 410.0))).apply(recording, 0)
    rows = [k for k, t in enumerate(recording.position.t_s) if not (40 <= t < 50 or 115 <= t < 120)]
    for name in gone:
        before, after = getattr(recording, name), getattr(done, name)
        np.testing.assert_array_equal(after.t_s, before.t_s[rows])

    if "position" in gone:
        np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[rows])
    assert all(getattr(done, name) is getattr(recording, name) for name in (*stays, "imu", "reference"))
    assert done.outages_s.tolist() == [[40, 50], [115, 120]]


def test_a_wheel_and_odometry_stay_and_headings_of_the_receiver_go(make, recording):
    t_s = recording.heading.t_s
    zeros, sigma = np.zeros(len(t_s)), np.full(len(t_s), 0.01)
    driven = make(velocity=Velocity.along_course(t_s, zeros, 0.1), heading=Heading(t_s, zeros, sigma, "odometry"))
    done = GnssOutage(heading=True).apply(driven, 0)
    assert done.velocity is driven.velocity
    assert done.heading is driven.heading
    course = GnssOutage().apply(make(heading=Heading(t_s, zeros, sigma, "course")), 0)
    asked = GnssOutage(heading=True).apply(recording, 0)
    for one in (course, asked):
        assert one.heading.t_s.tolist() == one.position.t_s.tolist()


def test_outages_add_up_and_regular_windows_replace_the_given_ones(recording):
    first = GnssOutage(windows_s=((10.0, 20.0),)).apply(recording, 0)
    second = GnssOutage(windows_s=((115.0, 130.0),)).apply(first, 0)
    assert second.outages_s.tolist() == [[10, 20], [115, 120]]
    regular = GnssOutage(count=3, length_s=5.0, first_s=20.0, every_s=30.0).apply(recording, 0)
    assert regular.outages_s.tolist() == [[20, 25], [50, 55], [80, 85]]


@pytest.mark.parametrize(
    ("plugin", "missing"), [(PositionOutage, "has no position fixes"), (VelocityOutage, "has no velocity")]
)
def test_what_is_not_there_cannot_be_missing(make, plugin, missing):
    with pytest.raises(RecordingError, match=f"made {missing}"):
        plugin().apply(make(position=None, velocity=None), 0)


def test_the_sweep_begins_everywhere_and_never_overlaps(make):
    recording = make(duration_s=150.0)
    plugin = OutageSweep(length_s=5.0)
    begins = []
    for seed in range(plugin.replicates()):
        done = plugin.apply(recording, seed)
        np.testing.assert_allclose(np.diff(done.outages_s, axis=1), 5.0)
        assert (done.outages_s[1:, 0] - done.outages_s[:-1, 1]).min(initial=99.0) >= 50
        lost = np.setdiff1d(recording.position.t_s, done.position.t_s)
        assert len(lost) == 20 * len(done.outages_s)  # 5 s at 4 Hz, each whole
        begins += done.outages_s[:, 0].tolist()
    assert sorted(begins) == [20 + 10.0 * k for k in range(13)]


@pytest.mark.parametrize(("length_s", "last"), [(2.0, 140.0), (10.0, 140.0), (20.0, 130.0), (30.0, 120.0)])
def test_the_begins_do_not_depend_on_the_length_but_where_none_fits(make, length_s, last):
    plugin = OutageSweep(length_s=length_s)
    windows = np.concatenate([plugin.apply(make(duration_s=150.0), seed).outages_s for seed in range(6)])
    assert sorted(windows[:, 0]) == [20 + 10.0 * k for k in range(round((last - 20) / 10) + 1)]
    np.testing.assert_allclose(windows[:, 1] - windows[:, 0], length_s)


def test_the_heading_goes_when_asked_and_a_given_phase_is_kept(recording):
    done = OutageSweep(phase=1, heading=True).apply(recording, 5)
    assert done.outages_s.tolist() == [[30, 40], [90, 100]]
    assert done.heading.t_s.tolist() == done.position.t_s.tolist()
    assert OutageSweep(phase=1).replicates() == 1


def test_the_metric_reads_the_error_at_the_ends_of_the_sweep(make):
    """An error that grows by 1 m/s from each begin on is 9.75 m at the last stamp before each end."""
    t_s = np.arange(481) / 4
    recording = make(reference=Reference(t_s, "truth", independent=True, enu_m=np.zeros((481, 3))))
    done = OutageSweep(phase=2).apply(recording, 0)
    since = np.array([max((t - begin for begin, end in done.outages_s if begin <= t < end), default=0.0) for t in t_s])
    position = np.column_stack([since, np.zeros((481, 2))])
    estimate = Estimate(np.arange(481), position, 0 * position, np.zeros((481, 6, 6)), 0 * position)
    values = Outage().evaluate(estimate, done, np.ones(481, dtype=bool))
    assert values["outage_end_m"] == pytest.approx(9.75)
    assert values["outage_end_max_m"] == pytest.approx(9.75)


def test_a_recording_too_short_for_an_outage_is_one_sentence(make):
    with pytest.raises(RecordingError, match=r"25\.0 s.* 10\.0 s"):
        OutageSweep().apply(make(duration_s=25.0), 0)
