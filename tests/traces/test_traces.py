"""Traces: how they are derived, kept, and told apart."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.errors import RecordingError
from jerkbench.jobs.names import choose
from jerkbench.plugins import create
from jerkbench.recording import Position, Recording, Reference
from jerkbench.simulation.traces import (
    SHIPPED,
    Trace,
    lagged_correlation,
    read_trace,
    shipped,
    trace_of,
    trace_path,
    trace_text,
    write_trace,
)

FOLDERS = {"tokyo_1105": "degraded/tokyo_1105", "pixel4": "degraded/pixel4", "comma2k19": "comma2k19"}


def recording(error, *, step_s=0.2, reference_s=None, **changes):
    t_s = np.arange(len(error)) * step_s
    own_s = t_s if reference_s is None else reference_s
    way = np.column_stack([3 * own_s, -2 * own_s, 0.1 * own_s])
    fixes = np.column_stack([3 * t_s, -2 * t_s, 0.1 * t_s]) + error
    parts = {
        "name": "made",
        "imu": None,
        "reference": Reference(own_s, "a better one", independent=True, enu_m=way),
        "position": Position(t_s, fixes, np.tile(np.diag([1.0, 4.0, 9.0]), (len(t_s), 1, 1))),
    }
    return Recording(**(parts | changes))


def noise(rows=50, seed=0):
    return np.random.default_rng(seed).normal(size=(rows, 3))


def test_errors_are_fix_less_reference_between_its_stamps_and_without_their_median():
    error = noise() + np.array([5.0, 0.0, -7.0])
    trace = trace_of(recording(error))
    np.testing.assert_allclose(trace.error_m, error - np.median(error, axis=0), atol=1e-12)
    np.testing.assert_allclose(trace.about.offset_m, np.median(error, axis=0))
    np.testing.assert_allclose(trace_of(recording(error), centred=False).error_m, error, atol=1e-12)
    own_s = np.concatenate([np.arange(0.05, 4, 0.1), np.arange(6.05, 9.9, 0.1)])
    error = noise()
    trace = trace_of(recording(error, reference_s=own_s), centred=False)
    t_s = np.arange(50) * 0.2
    inside = ((t_s >= 0.05) & (t_s <= 3.95)) | ((t_s >= 6.05) & (t_s <= own_s[-1]))
    np.testing.assert_allclose(trace.error_m, error[inside], atol=1e-9)
    assert np.diff(trace.t_s).max() > 2


@pytest.mark.parametrize("error", [np.zeros((50, 3)), np.ones((5, 3))])
def test_what_has_no_errors_makes_no_trace(error):
    with pytest.raises(RecordingError, match=r"copy of its fixes|are needed"):
        trace_of(recording(error))


def test_a_trace_survives_its_file_and_an_invalid_one_raises(tmp_path):
    covariance = np.tile([[4.0, 1.0, -0.5], [1.0, 9.0, 2.0], [-0.5, 2.0, 1.0]], (50, 1, 1))
    trace = Trace(np.arange(50) * 0.2, noise(), covariance)
    write_trace(trace, tmp_path / "a.parquet")
    again = read_trace(tmp_path / "a.parquet")
    np.testing.assert_allclose(again.error_m, trace.error_m, atol=6e-5)
    np.testing.assert_allclose(again.covariance_m2, covariance, rtol=2e-3, atol=5e-3)
    assert again.about == trace.about
    (tmp_path / "a.parquet").write_text("no")
    with pytest.raises(RecordingError, match="not a trace"):
        read_trace(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match="tokyo_1105"):
        trace_path("tokio")
    with pytest.raises(RecordingError, match="does not exist"):
        trace_path(str(tmp_path / "gone.parquet"))


def test_the_local_moment_is_the_mean_of_the_neighbours():
    trace = Trace(np.array([*range(10), 30.0]), noise(11), np.tile(np.eye(3), (11, 1, 1)))
    moment = trace.local_moment_m2(4.0)
    expected = np.mean([np.outer(e, e) for e in trace.error_m[3:8]], axis=0)
    np.testing.assert_allclose(moment[5], expected)
    np.testing.assert_allclose(moment[10], np.outer(trace.error_m[10], trace.error_m[10]))


@pytest.mark.parametrize("name", shipped())
def test_a_trace_of_this_package_has_its_licence_and_origin_beside_it(name):
    trace = read_trace(trace_path(name))
    assert trace.about.licence in ("BSD-2-Clause", "MIT")
    assert trace.about.origin.startswith("https://")
    assert "Copyright" in (SHIPPED / f"{name}.LICENSE").read_text(encoding="utf-8")
    assert trace_path(name).stat().st_size < 200_000
    assert f"| {name} |" in (SHIPPED / "README.md").read_text(encoding="utf-8")


def test_tokyos_trace_is_what_was_measured_elsewhere():
    """Horizontal rms 1.4 m, 95 % 3.1 m, largest 20 m; autocorrelation .65, .42 / .23."""
    trace = read_trace(trace_path("tokyo_1105"))
    level = np.hypot(*trace.error_m[:, :2].T)
    assert np.sqrt(np.mean(level**2)) == pytest.approx(1.4, abs=0.05)
    assert np.quantile(level, 0.95) == pytest.approx(3.1, abs=0.05)
    assert level.max() == pytest.approx(20, abs=0.5)
    assert lagged_correlation(trace, 1.0)[:2].mean() == pytest.approx(0.65, abs=0.05)
    np.testing.assert_allclose(np.sort(lagged_correlation(trace, 10.0)[:2]), [0.23, 0.42], atol=0.05)
    assert "NEES" in trace_text(trace)


@pytest.mark.parametrize("name", shipped())
def test_the_recordings_give_the_traces_of_this_package(name, shared_folder, tmp_path):
    folder = shared_folder / "data" / FOLDERS[name]
    if not folder.is_dir():
        pytest.skip(f"{folder.name} is not there")
    source = create("dataset", choose("dataset", {"name": name, "folder": str(folder)}).plain).load(0)
    write_trace(trace_of(source), tmp_path / "again.parquet")
    again, kept = read_trace(tmp_path / "again.parquet"), read_trace(trace_path(name))
    for field in ("t_s", "error_m", "covariance_m2"):
        np.testing.assert_array_equal(getattr(again, field), getattr(kept, field))


def test_a_trace_of_any_recording_can_be_replayed(tmp_path, typed):
    done = typed("data", "trace", "field", "own.parquet", "--set", "duration_s=30", "--licence", "MIT")
    assert done.returncode == 0, done.stderr
    assert "errors of 150 fixes of field against simulated truth" in done.stdout
    words = ["filter=baseline", "dataset.duration_s=20", "seeds=1", "study=replayed"]
    done = typed("run", *words, "disturbance=replayed_gnss", "disturbance.replayed_gnss.trace=own.parquet")
    assert done.returncode == 0, done.stderr
    assert "Its fixes have replayed errors: the errors of field" in done.stdout
    assert len(pd.read_parquet(tmp_path / "own.parquet")) == 150


@pytest.mark.parametrize(("target", "word"), [("own.parquet", "already exists"), ("a.csv", "suffix")])
def test_what_cannot_be_written_is_a_sentence(tmp_path, typed, target, word):
    (tmp_path / "own.parquet").touch()
    done = typed("data", "trace", "field", target)
    assert done.returncode == 2
    assert word in done.stderr
