"""Replayed errors have the distribution and correlation of the trace, and the documented covariances."""

import numpy as np
import pytest
from scipy.stats import ks_2samp

from jerkbench.disturbances.replayed_gnss import ReplayedGnss
from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.job import Protocol, build
from jerkbench.recording import Position, Recording, Reference
from jerkbench.simulation.traces import Trace, read_trace, trace_path, write_trace

NOISE_M2 = 1e-4


def drive(duration_s, step_s, *, independent=True, start_s=0.0):
    """Fixes with noise, and the truth at their stamps."""
    t_s = start_s + np.arange(round(duration_s / step_s)) * step_s
    way = np.column_stack([t_s, 0.5 * t_s, 0 * t_s])
    noise = np.random.default_rng(9).normal(scale=np.sqrt(NOISE_M2), size=way.shape)
    return Recording(
        "drive",
        None,
        Reference(t_s, "truth", independent=independent, enu_m=way),
        Position(t_s, way + noise, np.tile(NOISE_M2 * np.eye(3), (len(t_s), 1, 1))),
    )


def errors(done):
    rows = np.searchsorted(done.reference.t_s, done.position.t_s - 1e-9)
    return done.position.t_s, done.position.enu_m - done.reference.enu_m[rows]


def on_grid(t_s, values, step_s):
    grid = np.full((round((t_s[-1] - t_s[0]) / step_s) + 1, values.shape[1]), np.nan)
    grid[np.round((t_s - t_s[0]) / step_s).astype(int)] = values
    return grid


def level_autocorrelation(t_s, error, step_s, lag_s):
    """Autocorrelation of the horizontal error vector, which does not depend on a rotation."""
    grid = on_grid(t_s, error[:, :2] - error[:, :2].mean(axis=0), step_s)
    k = round(lag_s / step_s)
    return np.nanmean((grid[k:] * grid[:-k]).sum(axis=1)) / np.nanmean((grid**2).sum(axis=1))


@pytest.mark.parametrize("name", ["tokyo_1105", "pixel4"])
@pytest.mark.parametrize("seed", [0, 1])
def test_over_one_period_every_error_of_the_trace_occurs_once(name, seed):
    trace = read_trace(trace_path(name))
    step_s = trace.interval_s
    done = ReplayedGnss(trace=name).apply(drive(trace.period_s, step_s), seed)
    t_s, error = errors(done)
    assert len(error) == len(trace.t_s)
    for part in (lambda e: np.hypot(e[:, 0], e[:, 1]), lambda e: e[:, 2]):
        np.testing.assert_allclose(np.sort(part(error)), np.sort(part(trace.error_m)), atol=1e-9)
    t_s, error = errors(ReplayedGnss(trace=name, start_s=0.0).apply(drive(trace.period_s, step_s), seed))  # no seam
    for lag_s in (1.0, 10.0):
        expected = level_autocorrelation(trace.t_s, trace.error_m, step_s, lag_s)
        assert level_autocorrelation(t_s, error, step_s, lag_s) == pytest.approx(expected, abs=1e-9)
    reported = np.trace(done.position.covariance_m2, axis1=1, axis2=2)
    said = np.trace(trace.covariance_m2, axis1=1, axis2=2)
    np.testing.assert_allclose(np.sort(reported), np.sort(said), rtol=1e-9)


def test_over_many_seeds_the_distribution_agrees_with_the_trace():
    trace = read_trace(trace_path("tokyo_1105"))
    some = [errors(ReplayedGnss().apply(drive(60, 12.0), seed))[1] for seed in range(300)]
    together = np.concatenate(some)
    assert ks_2samp(np.hypot(*together[:, :2].T), np.hypot(*trace.error_m[:, :2].T)).pvalue > 0.01
    course = np.arctan2(together[:, 1], together[:, 0])
    assert ks_2samp(course, np.random.default_rng(0).uniform(-np.pi, np.pi, 100_000)).pvalue > 0.01


def user_trace(tmp_path, t_s, error, name="user", variance=0.25):
    covariance = np.tile(np.diag([variance, 4 * variance, 9 * variance]), (len(t_s), 1, 1))
    path = tmp_path / f"{name}.parquet"
    write_trace(Trace(np.asarray(t_s, dtype=float), error, covariance), path)
    return str(path)


@pytest.fixture
def steps(tmp_path):
    """A trace with 1 Hz, an error of k metres to the east in row k, and a gap from 9 to 15 s."""
    t_s = np.array([*range(10), *range(15, 25)])
    return user_trace(tmp_path, t_s, np.column_stack([t_s, 0 * t_s, 0 * t_s]).astype(float))


def test_fixes_in_gaps_are_dropped_and_one_row_gives_one_fix(steps):
    still = ReplayedGnss(trace=steps, start_s=2.0, rotate=False)
    t_s, error = errors(still.apply(drive(20.25, 0.25), 0))
    np.testing.assert_allclose(t_s, [*range(8), *range(13, 21)])
    np.testing.assert_allclose(error[:, 0], t_s + 2.0, atol=1e-9)
    t_s, error = errors(still.apply(drive(20, 2.0), 0))  # a trace with a higher rate than the fixes
    np.testing.assert_allclose(error[:, 0], t_s + 2.0, atol=1e-9)


def test_after_its_end_the_trace_is_repeated(steps):
    _, error = errors(ReplayedGnss(trace=steps, start_s=23.0, rotate=False).apply(drive(5, 1.0), 0))
    np.testing.assert_allclose(error[:, 0], [23, 24, 0, 1, 2], atol=1e-9)


def test_covariances_are_scaled_and_rotated_and_replace_the_covariance_of_the_fix(tmp_path):
    error = np.tile([3.0, 0.0, 1.0], (20, 1))
    trace = user_trace(tmp_path, np.arange(20), error)
    one = ReplayedGnss(trace=trace, scale=0.5)
    done = one.apply(drive(20, 1.0), 7)
    _, laid = errors(done)
    W = np.array([[laid[0, 0], -laid[0, 1], 0], [laid[0, 1], laid[0, 0], 0], [0, 0, 1.5]]) / 1.5
    reported = 0.25 * W @ np.diag([0.25, 1.0, 2.25]) @ W.T
    np.testing.assert_allclose(done.position.covariance_m2[3], reported, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(done.position.true_covariance_m2[3], np.outer(laid[3], laid[3]), rtol=1e-5, atol=1e-6)


def test_without_an_independent_reference_the_noise_and_its_covariance_remain(tmp_path):
    trace = user_trace(tmp_path, np.arange(20), np.tile([3.0, 0.0, 1.0], (20, 1)))
    before = drive(20, 1.0, independent=False)
    done = ReplayedGnss(trace=trace, rotate=False).apply(before, 0)
    np.testing.assert_allclose(
        done.position.enu_m - before.position.enu_m, np.tile([3.0, 0.0, 1.0], (20, 1)), atol=1e-6
    )
    np.testing.assert_allclose(done.position.covariance_m2[0], np.diag([0.25, 1.0, 2.25]) + NOISE_M2 * np.eye(3))
    moment = np.outer([3.0, 0.0, 1.0], [3.0, 0.0, 1.0])
    np.testing.assert_allclose(done.position.true_covariance_m2[0], moment + (NOISE_M2 + 1e-6) * np.eye(3), rtol=1e-6)


def test_the_true_covariance_agrees_with_the_size_of_the_errors():
    trace = read_trace(trace_path("tokyo_1105"))
    done = ReplayedGnss().apply(drive(trace.period_s, trace.interval_s), 3)
    _, error = errors(done)
    nees = np.einsum("mi,mij,mj->m", error, np.linalg.inv(done.position.true_covariance_m2), error)
    assert nees.mean() == pytest.approx(3, rel=0.15)
    reported = np.einsum("mi,mij,mj->m", error, np.linalg.inv(done.position.covariance_m2), error)
    assert reported.mean() > 1000


def test_the_key_depends_on_the_content_of_a_trace(tmp_path):
    def key(trace):
        spec = {kind: {"name": name} for kind, name in PARTS.items()}
        spec["disturbance"] = [{"name": "replayed_gnss", "trace": trace}]
        cell = build(spec, Protocol())
        return cell.key

    path = user_trace(tmp_path, np.arange(20), np.ones((20, 3)))
    before = key(path)
    user_trace(tmp_path, np.arange(20), 2 * np.ones((20, 3)))
    assert key(path) != before


PARTS = {"dataset": "field", "attitude": "tilt", "filter": "baseline", "adaptation": "none", "engine": "compiled"}


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({"scale": 0.0}, PluginError),
        ({"start_s": float("nan")}, PluginError),
        ({"trace": "tokio"}, RecordingError),
    ],
)
def test_wrong_parameters_are_refused(values, error):
    with pytest.raises(error):
        ReplayedGnss(**values)
