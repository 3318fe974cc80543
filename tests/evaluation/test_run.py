"""Which rows count, merging of metrics, and the status of a run."""

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.estimate import Updates
from jerkbench.evaluation.run import counted_rows, evaluate_run, run_status

METRICS = ("attitude_rmse", "consistency", "outage", "position_rmse", "velocity_rmse")


def all_metrics():
    return [plugins.create("metric", {"name": name}) for name in METRICS]


def without_reference(recording):
    reference = dataclasses.replace(recording.reference, enu_m=None, velocity_mps=None, euler_rad=None)
    return dataclasses.replace(recording, reference=reference, outages_s=np.empty((0, 2)))


def test_the_metrics_are_registered():
    assert set(METRICS) <= set(plugins.names("metric"))


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


def test_every_column_is_there_and_a_number(estimate, recording):
    values = evaluate_run(estimate, recording, 5.0, all_metrics())
    assert len(values) == 20
    assert all(type(value) is float and math.isfinite(value) for value in values.values())


def test_what_does_not_apply_is_nan_and_never_missing(estimate, recording):
    blind = dataclasses.replace(estimate, updates=Updates.empty())
    values = evaluate_run(blind, without_reference(recording), 5.0, all_metrics())
    assert set(values) == set(evaluate_run(estimate, recording, 5.0, all_metrics()))
    assert all(math.isnan(value) for value in values.values())


def test_a_burn_in_longer_than_the_run_leaves_nothing_but_the_whole(estimate, recording):
    values = evaluate_run(estimate, recording, 1e6, all_metrics())
    assert [name for name, value in values.items() if math.isfinite(value)] == ["position_rmse_whole_m"]


def test_two_metrics_may_not_give_the_same_column(estimate, recording):
    twice = [plugins.create("metric", {"name": "outage"})] * 2
    with pytest.raises(PluginError, match=r"metrics Outage and Outage both give the column 'outage_rmse_m'"):
        evaluate_run(estimate, recording, 5.0, twice)


def test_a_good_run_is_ok(estimate, recording):
    assert run_status(estimate, recording) == ("ok", "")


def test_a_run_that_stopped_early_says_why(estimate, recording):
    stopped = dataclasses.replace(estimate, failure="The covariance is not positive definite at 3.20 s.")
    assert run_status(stopped, recording) == ("diverged", "The covariance is not positive definite at 3.20 s.")


@pytest.mark.parametrize("field", ["position_m", "velocity_mps"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_that_is_not_finite_says_when(estimate, recording, field, bad):
    state = getattr(estimate, field).copy()
    state[[33, 50], 1] = bad
    status = run_status(dataclasses.replace(estimate, **{field: state}), recording)
    assert status == ("diverged", f"The state is not finite at {recording.reference.t_s[5 + 33]:.2f} s.")


@pytest.mark.parametrize("row", [30, 20])
def test_a_position_too_far_off_says_where(estimate, recording, row):
    """Row 30 is the reference's row 35, row 20 its row 25, where only east and north are known."""
    position_m = estimate.position_m.copy()
    position_m[row:, 0] += 1234.0
    status, reason = run_status(dataclasses.replace(estimate, position_m=position_m), recording)
    assert status == "diverged"
    assert reason.endswith(f" m at {recording.reference.t_s[5 + row]:.2f} s; the limit is 1000 m.")
    assert 1225 < float(reason.split()[4]) < 1245


def test_the_limit_is_a_parameter(estimate, recording):
    position_m = estimate.position_m + np.array([0.0, 50.0, 0.0])
    moved = dataclasses.replace(estimate, position_m=position_m)
    assert run_status(moved, recording)[0] == "ok"
    assert run_status(moved, recording, limit_m=20.0)[0] == "diverged"


def test_an_unknown_reference_row_cannot_diverge(estimate, recording):
    position_m = estimate.position_m.copy()
    position_m[15] += 1e6  # the reference's row 20 is NaN
    assert run_status(dataclasses.replace(estimate, position_m=position_m), recording)[0] == "ok"


def test_a_run_that_reached_nothing_diverged(estimate, recording):
    cut = {name: getattr(estimate, name)[:0] for name in ("index", "position_m", "velocity_mps", "covariance")}
    status, reason = run_status(dataclasses.replace(estimate, **cut), recording)
    assert (status, reason) == ("diverged", "The run reached none of the reference's stamps.")


def test_metrics_import_nothing_heavy():
    code = (
        "import pkgutil, importlib, sys, jerkbench.evaluation as e\n"
        "[importlib.import_module('jerkbench.evaluation.' + m.name) for m in pkgutil.iter_modules(e.__path__)]\n"
        "print([m for m in ('scipy', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
