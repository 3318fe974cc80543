import numpy as np
import pytest

from jerkbench.disturbances.outages import OutageSweep, PositionOutage, VelocityOutage
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.metrics.recovery import Outage
from jerkbench.recording import Reference


@pytest.mark.parametrize(
    ("plugin", "gone", "stays"),
    [(PositionOutage, "position", ("velocity", "heading")), (VelocityOutage, "velocity", ("position", "heading"))],
)
def test_one_goes_and_the_others_stay(recording, plugin, gone, stays):
    done = plugin(windows_s=((40.0, 50.0), (115.0, 300.0))).apply(recording, 0)
    expected = [t for t in getattr(recording, gone).t_s if not (40 <= t < 50 or 115 <= t < 120)]
    assert getattr(done, gone).t_s.tolist() == expected
    assert all(getattr(done, name) is getattr(recording, name) for name in (*stays, "imu", "reference"))
    assert done.outages_s.tolist() == [[40, 50], [115, 120]]


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
