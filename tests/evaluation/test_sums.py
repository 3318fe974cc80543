"""The sums of a trajectory, one compiled pass, against NumPy's passes."""

import dataclasses

import numpy as np
import numpy_sums
import pytest
from scored_run import make_estimate, make_recording

from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import sums_of


def with_holes(recording, name, rows, axes):
    values = getattr(recording.reference, name).copy()
    values[rows, axes] = np.nan
    return dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, **{name: values}))


def known(recording):
    """The same recording without a hole in its reference."""
    values = {name: np.nan_to_num(getattr(recording.reference, name)) for name in ("enu_m", "velocity_mps")}
    return dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, **values))


def assert_same(estimate, recording, burn_in_s=5.0):
    counted = counted_rows(estimate, recording, burn_in_s)
    got, wanted = sums_of(estimate, recording, counted), numpy_sums.sums_of(estimate, recording, counted)
    for name, value in wanted._asdict().items():
        np.testing.assert_allclose(getattr(got, name), value, rtol=1e-12, atol=0, err_msg=name)
    return got


def test_the_sums_are_those_of_numpy_and_without_a_row_that_counts_there_is_no_largest_error(estimate, recording):
    assert_same(estimate, recording)
    assert_same(estimate, known(recording))
    recording = make_recording()
    estimate = make_estimate(recording)
    assert np.isnan(assert_same(estimate, recording, burn_in_s=1e9).position_max_m)


@pytest.mark.parametrize("name", ["enu_m", "velocity_mps"])
def test_what_the_reference_knows_decides_on_each_axis(estimate, recording, name):
    assert_same(estimate, with_holes(recording, name, slice(12, 30), 0))
    assert_same(estimate, with_holes(recording, name, slice(None), 2))
    without = dataclasses.replace(recording.reference, **{name: None})
    assert_same(estimate, dataclasses.replace(recording, reference=without))


@pytest.mark.parametrize("name", ["position_m", "velocity_mps"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
@pytest.mark.parametrize("row", [1, 40], ids=["does not count", "counts"])
def test_what_is_no_number_stays_none_where_it_counts(recording, name, value, row):
    estimate = make_estimate(recording)
    values = getattr(estimate, name).copy()
    values[row, 1] = value
    assert_same(dataclasses.replace(estimate, **{name: values}), known(recording))


@pytest.mark.parametrize("state", [0, 2, 4])
def test_of_a_covariance_that_is_not_positive_definite_there_is_no_distance(recording, state):
    estimate = make_estimate(recording)
    P = estimate.covariance.copy()
    P[40, state, state] = -1.0
    got = assert_same(dataclasses.replace(estimate, covariance=P), known(recording))
    assert np.isnan(got.nees)
    assert np.isnan(got.nees_position) == (state < 3)


def test_dropped_rows_and_arrays_that_cannot_be_written_make_no_difference(recording):
    estimate = make_estimate(recording)
    R = estimate.updates.R_diagonal.copy()
    R[10:20, 1] = np.inf
    estimate.covariance.flags.writeable = False
    assert_same(dataclasses.replace(estimate, updates=dataclasses.replace(estimate.updates, R_diagonal=R)), recording)
