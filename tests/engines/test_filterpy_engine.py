"""Whole runs on the reference engine, against closed forms and against plain NumPy."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation, Oracle
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Baseline, Bias, Jerk
from jerkbench.recording import Position
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest


def run(model, recording, accel=(0.0, 0.0, 0.0), adaptation=None, engine=None):
    timeline = build_timeline(recording, level_attitude(recording, accel))
    return (engine or FilterpyEngine()).run(timeline, model, adaptation or NoAdaptation())


def noisy(recording, seed=1):
    """The recording with position noise of its own covariance."""
    rng = np.random.default_rng(seed)
    position = recording.position
    return replace(recording, position=replace(position, enu_m=rng.normal(0.0, 0.01, position.enu_m.shape)))


@pytest.mark.parametrize(
    ("sigma_a", "offset_m", "mean_m"), [(0.02, 1.936, 2.126), (0.1, 0.2862, 0.360), (0.2, 0.1071, 0.152)]
)
def test_a_constant_acceleration_error_puts_the_baseline_off_by_g_b(sigma_a, offset_m, mean_m):
    b = 0.1
    estimate = run(Baseline(sigma_a), recording_at_rest(duration_s=120.0), accel=(b, 0.0, 0.0))
    period = estimate.position_m[-20:, 0] / b  # 5 Hz updates of a 100 Hz filter; the last row is an update

    assert period[-1] == pytest.approx(offset_m, rel=1e-3)
    assert period.mean() == pytest.approx(mean_m, rel=2e-2)


def test_the_jerk_filter_takes_a_constant_acceleration_error_away():
    estimate = run(Jerk(), recording_at_rest(duration_s=120.0), accel=(0.1, 0.0, 0.0))

    assert np.abs(estimate.position_m[-1]).max() < 1e-4


def test_the_covariance_settles_where_the_riccati_equation_says():
    recording = recording_at_rest(duration_s=60.0, imu_rate_hz=5, gnss_rate_hz=5)
    estimate = run(Baseline(0.2), recording)
    A, b = np.array([[1.0, 0.2], [0.0, 1.0]]), np.array([0.02, 0.2])
    R = np.diag([0.01**2, 0.03**2])
    prior = solve_discrete_are(A.T, np.eye(2), 0.2**2 * np.outer(b, b), R)
    posterior = prior - prior @ np.linalg.solve(prior + R, prior)

    np.testing.assert_allclose(estimate.covariance[-1][np.ix_([0, 3], [0, 3])], posterior, rtol=1e-9)


def test_splitting_a_sample_keeps_the_velocity_variance():
    recording = recording_at_rest(duration_s=1.0, velocity=None, gnss_rate_hz=1)
    at = np.array([0.005])  # start between two samples, and one reference row more at each third of a millisecond
    recording = replace(recording, position=Position(at, np.zeros((1, 3)), 1e-4 * np.eye(3)[None]))
    stamps = np.round(np.arange(0.0, 1.0001, 1 / 300)[2:], 9)
    split = replace(
        recording,
        reference=replace(
            recording.reference,
            t_s=stamps,
            enu_m=np.zeros((len(stamps), 3)),
            velocity_mps=None,
            scored=None,
        ),
    )
    whole = run(Baseline(0.2), recording).covariance[-1, 3, 3]
    parts = run(Baseline(0.2), split).covariance[-1, 3, 3]

    assert parts == pytest.approx(whole, rel=1e-5)
    assert whole - 100.0 == pytest.approx(0.2**2 * 0.01 * 0.995, rel=1e-3)  # P0 + sigma_a^2 dt0 T


def test_jerk_and_bias_with_half_the_step_between_them_are_the_same_filter():
    recording, dt = noisy(recording_at_rest(duration_s=60.0)), 0.01
    jerk = Jerk(0.1, 6.0, 20.0)
    bias = Bias(0.1, 6.0 * dt / 2, 20.0 * dt / 2)

    difference = run(jerk, recording).position_m - run(bias, recording).position_m
    assert np.abs(difference).max() < 1e-4


def test_rows_that_are_absent_do_not_count():
    recording = noisy(recording_at_rest(duration_s=10.0))
    masked = recording.position.enu_m.copy()
    masked[5:, 2] = np.nan
    without_up = replace(recording, position=replace(recording.position, enu_m=masked))
    full, part = run(Baseline(), recording), run(Baseline(), without_up)

    np.testing.assert_allclose(part.position_m[:, :2], full.position_m[:, :2], atol=1e-12)
    assert part.covariance[-1, 2, 2] > 2 * full.covariance[-1, 2, 2]
    assert part.updates.rows[-1] == 5


@dataclass(frozen=True)
class DropPosition:
    def memory_size(self):
        return 0

    def adapt(self, innovation, HPHt, R, rows, memory):
        dropped = R.copy()
        dropped[rows < 3, rows < 3] = np.inf
        return dropped


@dataclass(frozen=True)
class DropAll(DropPosition):
    def adapt(self, innovation, HPHt, R, rows, memory):
        return np.diag(np.full(len(rows), np.inf))


def test_an_infinite_variance_drops_its_row():
    recording = noisy(recording_at_rest(duration_s=5.0))
    fixes = recording.position
    first = replace(fixes, t_s=fixes.t_s[:1], enu_m=fixes.enu_m[:1], covariance_m2=fixes.covariance_m2[:1])
    dropped = run(Baseline(), recording, adaptation=DropPosition())
    absent = run(Baseline(), replace(recording, position=first))

    np.testing.assert_allclose(dropped.position_m, absent.position_m, atol=1e-12)
    np.testing.assert_allclose(dropped.covariance, absent.covariance, atol=1e-15)


def test_with_all_rows_dropped_there_is_no_update():
    recording = recording_at_rest(duration_s=2.0)
    estimate = run(Baseline(), recording, accel=(1.0, 0.0, 0.0), adaptation=DropAll())
    elapsed = 2.0 - 0.2

    assert estimate.position_m[-1, 0] == pytest.approx(0.5 * elapsed**2, rel=1e-9)
    assert np.isnan(estimate.updates.nis_used).all()


@dataclass(frozen=True)
class Fade(NoAdaptation):
    factor: float = 2.0

    def fade(self, innovation, HPHt, R, rows, memory):
        return self.factor


def test_fading_scales_the_prior_before_the_update():
    recording = recording_at_rest(duration_s=0.4)
    prior = run(Baseline(), recording, adaptation=DropAll()).covariance[-1]
    faded = run(Baseline(), recording, adaptation=Fade(3.0)).covariance[-1]
    R = np.diag([1e-4] * 3 + [9e-4] * 3)
    S = 3.0 * prior + R

    np.testing.assert_allclose(faded, 3.0 * prior - 9.0 * prior @ np.linalg.solve(S, prior), atol=1e-12)


def test_the_oracle_gets_the_true_covariance_and_the_reported_one_stays_for_the_nis():
    recording = recording_at_rest(duration_s=2.0)
    true = np.tile(np.eye(3), (len(recording.position.t_s), 1, 1))
    recording = replace(recording, position=replace(recording.position, true_covariance_m2=true))
    none, oracle = run(Baseline(), recording), run(Baseline(), recording, adaptation=Oracle())

    np.testing.assert_allclose(oracle.updates.R_diagonal[:, :3], 1.0)
    np.testing.assert_allclose(none.updates.R_diagonal[:, :3], 1e-4)
    assert oracle.covariance[-1, 0, 0] > none.covariance[-1, 0, 0]


def test_nis_is_that_of_a_chi_square_with_as_many_degrees_as_rows():
    rng = np.random.default_rng(3)
    rest = recording_at_rest(duration_s=400.0, imu_rate_hz=10)
    n = len(rest.position.t_s)
    recording = replace(
        rest,
        position=replace(rest.position, enu_m=rng.normal(0.0, 0.01, (n, 3))),
        velocity=replace(rest.velocity, mps=rng.normal(0.0, 0.03, (n, 3))),
    )
    u = rng.normal(0.0, 0.2, (len(rest.imu.t_s), 3))  # the body rests: all of u is error
    updates = run(Baseline(0.2), recording, accel=u).updates

    assert updates.nis[100:].mean() == pytest.approx(6.0, abs=3 * np.sqrt(12.0 / (n - 100)))
    np.testing.assert_allclose(updates.nis, updates.nis_used)


def test_mtf_that_never_triggers_changes_nothing_at_all():
    recording = recording_at_rest(duration_s=5.0)  # without noise no innovation is larger than expected
    none, mtf = run(Baseline(), recording), run(Baseline(), recording, adaptation=Mtf())

    np.testing.assert_array_equal(none.position_m, mtf.position_m)
    np.testing.assert_array_equal(none.covariance, mtf.covariance)


def test_the_paper_form_of_the_covariance_is_close_but_not_the_same():
    recording = noisy(recording_at_rest(duration_s=20.0))
    joseph = run(Jerk(), recording)
    paper = run(Jerk(), recording, engine=FilterpyEngine("paper"))

    np.testing.assert_allclose(paper.position_m, joseph.position_m, atol=1e-5)
    assert (paper.covariance != joseph.covariance).any()


def test_an_unknown_form_of_the_covariance_is_a_sentence():
    with pytest.raises(PluginError, match="Did you mean 'joseph'"):
        FilterpyEngine("josef")


@dataclass(frozen=True)
class Spoil(NoAdaptation):
    def adapt(self, innovation, HPHt, R, rows, memory):
        return -R


def test_a_covariance_that_is_no_longer_positive_definite_ends_the_run_with_the_reason():
    estimate = run(Baseline(), recording_at_rest(duration_s=2.0), adaptation=Spoil())

    assert estimate.failure == "the covariance is no longer positive definite at 0.40 s"
    assert len(estimate.index) < 200


def test_gnss_only_carries_the_last_fix_on_with_its_velocity():
    rest = recording_at_rest(duration_s=3.0, gnss_rate_hz=1)
    recording = replace(
        rest,
        position=replace(rest.position, enu_m=[[0, 0, 0], [1, 2, 3], [9, 9, 9]]),
        velocity=replace(rest.velocity, mps=[[1, 0, 0], [0.5, 0, -1], [9, 9, 9]]),
    )
    estimate = GnssOnly().estimate(recording, level_attitude(recording), NoAdaptation())
    at = int(np.flatnonzero(recording.reference.t_s[estimate.index] == 2.5)[0])

    np.testing.assert_allclose(estimate.position_m[at], [1.25, 2.0, 2.5])
    np.testing.assert_allclose(estimate.velocity_mps[at], [0.5, 0.0, -1.0])
    np.testing.assert_allclose(np.diag(estimate.covariance[at]), [1e-4 + 9e-4 * 0.25] * 3 + [9e-4] * 3)
    np.testing.assert_allclose(estimate.covariance[at, 0, 3], 9e-4 * 0.5)
