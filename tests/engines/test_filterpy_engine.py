"""Whole runs on the reference engine, against closed forms and against plain NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation, Oracle
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest, with_fix_noise


def run(model, recording, accel=(0.0, 0.0, 0.0), adaptation=None, engine=None):
    timeline = build_timeline(recording, level_attitude(recording, accel))
    return (engine or FilterpyEngine()).run(timeline, model, adaptation or NoAdaptation())


@pytest.mark.parametrize(
    ("sigma_a", "offset_m", "mean_m"), [(0.02, 1.936, 2.126), (0.1, 0.2862, 0.360), (0.2, 0.1071, 0.152)]
)
def test_a_constant_acceleration_error_puts_the_baseline_off_by_g_b(sigma_a, offset_m, mean_m):
    b = 0.1
    estimate = run(Baseline(sigma_a), recording_at_rest(duration_s=120.0), accel=(b, 0.0, 0.0))
    period = estimate.position_m[-20:, 0] / b  # 5 Hz updates of a 100 Hz filter; the last row is an update

    assert period[-1] == pytest.approx(offset_m, rel=1e-3)
    assert period.mean() == pytest.approx(mean_m, rel=2e-2)


class DropAll(NoAdaptation):
    def adapt(self, innovation, HPHt, R, rows, memory):
        return np.diag(np.full(len(rows), np.inf))


def test_with_all_rows_dropped_there_is_no_update():
    recording = recording_at_rest(duration_s=2.0)
    estimate = run(Baseline(), recording, accel=(1.0, 0.0, 0.0), adaptation=DropAll())
    elapsed = 2.0 - 0.2

    assert estimate.position_m[-1, 0] == pytest.approx(0.5 * elapsed**2, rel=1e-9)
    assert np.isnan(estimate.updates.nis_used).all()


def test_the_oracle_gets_the_true_covariance_and_the_reported_one_stays_for_the_nis():
    recording = recording_at_rest(duration_s=2.0)
    true = np.tile(np.eye(3), (len(recording.position.t_s), 1, 1))
    recording = replace(recording, position=replace(recording.position, true_covariance_m2=true))
    none, oracle = run(Baseline(), recording), run(Baseline(), recording, adaptation=Oracle())

    np.testing.assert_allclose(oracle.updates.R_diagonal[:, :3], 1.0)
    np.testing.assert_allclose(none.updates.R_diagonal[:, :3], 1e-4)
    assert oracle.covariance[-1, 0, 0] > none.covariance[-1, 0, 0]


def test_nis_is_that_of_a_chi_square_with_as_many_degrees_as_rows():
    rest = recording_at_rest(duration_s=400.0, imu_rate_hz=10)
    rng, n = np.random.default_rng(3), len(rest.position.t_s)
    recording = with_fix_noise(rest)
    u = rng.normal(0.0, 0.2, (len(rest.imu.t_s), 3))  # the body rests: all of u is error
    updates = run(Baseline(0.2), recording, accel=u).updates

    assert updates.nis[100:].mean() == pytest.approx(6.0, abs=3 * np.sqrt(12.0 / (n - 100)))
    np.testing.assert_allclose(updates.nis, updates.nis_used)


def test_the_paper_form_of_the_covariance_is_close_but_not_the_same():
    recording = with_fix_noise(recording_at_rest(duration_s=20.0))
    joseph = run(Jerk(), recording)
    paper = run(Jerk(), recording, engine=FilterpyEngine("paper"))

    np.testing.assert_allclose(paper.position_m, joseph.position_m, atol=1e-5)
    assert (paper.covariance != joseph.covariance).any()
    with pytest.raises(PluginError, match="Did you mean 'joseph'"):
        FilterpyEngine("josef")
