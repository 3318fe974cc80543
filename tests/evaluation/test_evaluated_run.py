"""The rows that count, the columns of the metrics, and the status of a run."""

import dataclasses
import math

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.errors import PluginError, RecordingError
from jerkbench.estimate import Updates
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import evaluate_run, run_status

LIMIT_M = 1000.0
METRICS = ("attitude_rmse", "consistency", "outage", "position_rmse", "velocity_rmse")
UNKNOWN = {"enu_m": None, "velocity_mps": None, "euler_rad": None}


def all_metrics():
    return [plugins.create("metric", {"name": name}) for name in METRICS]


def test_counted_rows_are_scored_late_and_known(estimate, recording):
    reference = recording.reference
    unknown = dataclasses.replace(reference, velocity_mps=None, euler_rad=None)
    counted = counted_rows(estimate, dataclasses.replace(recording, reference=unknown), 7.0)
    expected = [
        reference.scored[row] and reference.t_s[row] >= 7.0 and not np.isnan(reference.enu_m[row]).all()
        for row in estimate.index
    ]
    assert counted.tolist() == expected
    assert 0 < sum(expected) < len(expected)


def test_every_column_is_there_once_and_what_does_not_apply_is_nan(estimate, recording):
    values = evaluate_run(estimate, recording, 5.0, all_metrics())
    assert len(values) == 22
    assert all(type(value) is float and math.isfinite(value) for value in values.values())
    euler_rad = np.where([False, False, True], recording.reference.euler_rad, np.nan)
    reference = dataclasses.replace(recording.reference, enu_m=None, velocity_mps=None, euler_rad=euler_rad)
    yaw_alone = dataclasses.replace(recording, reference=reference, outages_s=np.empty((0, 2)))
    values = evaluate_run(dataclasses.replace(estimate, updates=Updates.empty()), yaw_alone, 5.0, all_metrics())
    assert list(values) == list(evaluate_run(estimate, recording, 5.0, all_metrics()))
    assert [name for name, value in values.items() if not math.isnan(value)] == ["yaw_rmse_rad"]
    twice = [plugins.create("metric", {"name": "outage"})] * 2
    with pytest.raises(PluginError, match="outage_rmse_m"):
        evaluate_run(estimate, recording, 5.0, twice)


def test_a_run_of_which_nothing_counts_is_a_sentence_and_without_a_reference_innovations_are_judged(
    estimate, recording
):
    with pytest.raises(RecordingError, match="burn_in_s"):
        evaluate_run(estimate, recording, 500.0, all_metrics())
    last_s = recording.reference.t_s[estimate.index[-1]]
    assert math.isfinite(evaluate_run(estimate, recording, last_s, all_metrics())["position_rmse_m"])
    reference = dataclasses.replace(recording.reference, **UNKNOWN)
    assert reference.empty
    assert not dataclasses.replace(recording.reference, **NOT_KNOWN).empty
    values = evaluate_run(estimate, dataclasses.replace(recording, reference=reference), 5.0, all_metrics())
    with_one = evaluate_run(estimate, recording, 5.0, all_metrics())
    assert values["anis_per_row"] == with_one["anis_per_row"]
    assert math.isnan(values["position_rmse_m"])
    assert math.isnan(values["anees"])


NOT_KNOWN = dict.fromkeys(UNKNOWN, np.full((70, 3), np.nan))


@pytest.mark.parametrize("changes", [{"scored": np.zeros(70, dtype=bool)}, NOT_KNOWN])
def test_a_reference_that_is_not_scored_or_not_known_is_a_sentence(estimate, recording, changes):
    reference = dataclasses.replace(recording.reference, **changes)
    with pytest.raises(RecordingError, match="burn-in"):
        evaluate_run(estimate, dataclasses.replace(recording, reference=reference), 5.0, all_metrics())


@pytest.mark.parametrize(("reached", "failure"), [(4, "The covariance is not positive definite at 4.50 s."), (0, "")])
def test_a_run_that_stopped_in_the_burn_in_stays_diverged(estimate, recording, reached, failure):
    names = ("index", "position_m", "velocity_mps", "covariance", "euler_rad")
    cut = {name: getattr(estimate, name)[:reached] for name in names}
    stopped = dataclasses.replace(estimate, **cut, failure=failure, updates=Updates.empty())
    values = evaluate_run(stopped, recording, 5.0, all_metrics())
    assert run_status(stopped, recording, LIMIT_M)[0] == "diverged"
    assert math.isnan(values["position_rmse_m"])


@pytest.mark.parametrize("field", ["position_m", "velocity_mps"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_that_is_not_finite_says_when(estimate, recording, field, bad):
    state = getattr(estimate, field).copy()
    state[[33, 50], 1] = bad
    status = run_status(dataclasses.replace(estimate, **{field: state}), recording, LIMIT_M)
    assert status == ("diverged", f"The state is not finite at {recording.reference.t_s[5 + 33]:.2f} s.")


@pytest.mark.parametrize("row", [30, 20])
def test_a_position_too_far_off_says_where(estimate, recording, row):
    """Row 30 is the reference's row 35, row 20 its row 25, where only east and north are known."""
    position_m = estimate.position_m.copy()
    position_m[row:, 0] += 1234.0
    status, reason = run_status(dataclasses.replace(estimate, position_m=position_m), recording, LIMIT_M)
    assert status == "diverged"
    assert reason.endswith(f" m at {recording.reference.t_s[5 + row]:.2f} s; the limit is 1000 m.")
    assert 1225 < float(reason.split()[4]) < 1245


def test_the_limit_is_a_parameter_and_a_run_says_why_it_stopped(estimate, recording):
    position_m = estimate.position_m + np.array([0.0, 50.0, 0.0])
    moved = dataclasses.replace(estimate, position_m=position_m)
    assert run_status(moved, recording, LIMIT_M)[0] == "ok"
    assert run_status(moved, recording, limit_m=20.0)[0] == "diverged"
    position_m = estimate.position_m.copy()
    position_m[15] += 1e6  # the reference's row 20 is NaN
    assert run_status(dataclasses.replace(estimate, position_m=position_m), recording, LIMIT_M)[0] == "ok"
    cut = {name: getattr(estimate, name)[:0] for name in ("index", "position_m", "velocity_mps", "covariance")}
    status, reason = run_status(dataclasses.replace(estimate, **cut), recording, LIMIT_M)
    assert (status, reason) == ("diverged", "The run reached none of the reference's stamps.")
    stopped = dataclasses.replace(estimate, failure="The covariance is not positive definite at 3.20 s.")
    assert run_status(stopped, recording, LIMIT_M) == ("diverged", "The covariance is not positive definite at 3.20 s.")
