import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jerkbench.disturbances.multipath import MultipathSingleAxis
from jerkbench.errors import RecordingError


def bursts_of(shift, t_s):
    """Runs of equal, non-zero shift: (first time, last time, shift)."""
    edges = np.flatnonzero(np.r_[True, (np.diff(shift, axis=0) != 0).any(axis=1), True])
    runs = [(t_s[begin], t_s[end - 1], shift[begin]) for begin, end in itertools.pairwise(edges)]
    return [run for run in runs if run[2].any()]


def bursts_with(recording, seed):
    shift = np.round(MultipathSingleAxis().apply(recording, seed).position.enu_m - recording.position.enu_m, 9)
    return bursts_of(shift, recording.position.t_s)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # the recording is the same for every seed
@given(st.integers(0, 2**31 - 1))
def test_bursts_are_as_many_as_long_and_as_large_as_said(make, seed):
    bursts = bursts_with(make(duration_s=150.0, rate_hz=10), seed)
    assert len(bursts) == 10
    for begin, end, offset in bursts:
        assert begin >= 10
        assert 1.8 <= end - begin <= 6.0  # between fixes 0.1 s apart
        assert np.count_nonzero(offset) == 1
        assert 0.5 <= np.abs(offset).max() <= 2.0


def test_every_axis_is_hit_in_both_directions(make):
    recording = make(duration_s=150.0, rate_hz=10)
    offsets = np.array([offset for seed in range(20) for *_, offset in bursts_with(recording, seed)])
    assert (np.sign(offsets).min(axis=0) == -1).all()
    assert (np.sign(offsets).max(axis=0) == 1).all()


def test_only_the_true_covariance_knows(recording):
    done = MultipathSingleAxis().apply(recording, 1).position
    np.testing.assert_array_equal(done.covariance_m2, recording.position.covariance_m2)
    shift = done.enu_m - recording.position.enu_m
    for reported, true, moved in zip(done.covariance_m2, done.true_covariance_m2, shift, strict=True):
        np.testing.assert_allclose(true, reported + np.diag(moved**2), atol=1e-9)


def test_what_is_not_measured_stays_so(make, recording):
    enu_m = recording.position.enu_m.copy()
    enu_m[:, 2] = np.nan
    position = dataclasses.replace(recording.position, enu_m=enu_m)
    done = MultipathSingleAxis().apply(make(position=position), 1).position
    assert np.isnan(done.enu_m[:, 2]).all()
    assert np.isfinite(done.enu_m[:, :2]).all()


def test_a_short_recording_and_one_without_position_are_named(make):
    with pytest.raises(RecordingError, match=r"do not fit after 10\.0 s"):
        MultipathSingleAxis().apply(make(duration_s=25.0), 0)
    with pytest.raises(RecordingError, match="has no position fixes"):
        MultipathSingleAxis().apply(make(position=None), 0)
