"""The posterior Cramer-Rao bound: against recursions written out, and against what filters reach."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.datasets.field import Field, FieldWhite
from jerkbench.disturbances.noise import NoiseStep
from jerkbench.disturbances.outages import GnssOutage
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.metrics.position import PositionRmse
from jerkbench.evaluation.metrics.position_bound import Motion, NoiseRows, PositionBound, position_variances
from jerkbench.filters.kinematic import Baseline, Bias, Jerk
from jerkbench.jobs.rows import simulated
from jerkbench.timeline import build_timeline

SIGMA = 0.02
FIELD = FieldWhite(duration_s=40.0)
OUTAGE = GnssOutage(windows_s=((20.0, 25.0),))


def dense_variances(recording, law):
    """All three axes in one state of 12, a step at a time, with gains by inverses."""
    dt = recording.imu.t_s[1] - recording.imu.t_s[0]
    keep = np.exp(-dt / np.repeat([law.position_time_s, law.velocity_time_s], 3))
    A = np.block([[np.eye(3), dt * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    B = np.vstack([dt**2 / 2 * np.eye(3), dt * np.eye(3)])
    F, Q = block_diag(A, np.diag(keep)), block_diag(law.accel_sigma_mps2**2 * B @ B.T, np.diag(1 - keep**2))
    P = block_diag(1e8 * np.eye(3), 1e6 * np.eye(3), np.eye(6))
    variances = []
    streams = (0, recording.position, law.position_share), (3, recording.velocity, law.velocity_share)
    for t in recording.imu.t_s:
        P = F @ P @ F.T + Q
        for at, stream, share in streams:
            row = np.flatnonzero(np.abs(stream.t_s - t) < 1e-6)
            if row.size:
                C = (stream.covariance_m2 if at == 0 else stream.covariance_m2ps2)[row[0]]
                H = np.zeros((3, 12))
                H[:, at : at + 3], H[:, 6 + at : 9 + at] = np.eye(3), np.sqrt(share * C)
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + (1 - share) * C)
                P = (np.eye(12) - K @ H) @ P @ (np.eye(12) - K @ H).T + K @ ((1 - share) * C) @ K.T
        variances.append(np.trace(P[:3, :3]))
    return np.array(variances)


def bound(recording, begin_s=5.0):
    return PositionBound().evaluate(*everywhere(recording, begin_s))["position_bound_m"]


def everywhere(recording, begin_s):
    """An estimate at every stamp of the reference, which is the reference."""
    estimate = CompiledEngine().run(timeline(recording), Baseline(SIGMA), NoAdaptation())
    return estimate, recording, recording.reference.t_s[estimate.index] >= begin_s


def timeline(recording):
    return build_timeline(recording, ReferenceAttitude().estimate(recording))


@pytest.mark.parametrize("dataset", [FIELD, Field(duration_s=40.0)], ids=["white", "coloured"])
@pytest.mark.parametrize("outage", [False, True])
def test_it_is_the_recursion_written_out(dataset, outage):
    drawn = dataset.load(0)
    recording = OUTAGE.apply(drawn, 0) if outage else drawn
    variances = dense_variances(recording, drawn.drawn)
    counted = recording.reference.t_s >= 5.0
    assert bound(recording) == pytest.approx(np.sqrt(variances[counted].mean()), rel=1e-6)


def test_it_settles_where_the_algebraic_equation_does():
    """One axis with a fix after each input: scipy's steady state."""
    dt, p, v = 0.1, 0.04, 0.09
    white = (
        NoiseRows(np.full((400, 3), p), np.zeros((400, 3)), 1.0),
        NoiseRows(np.full((400, 3), v), np.zeros((400, 3)), 1.0),
    )
    got = position_variances(Motion(dt, 0.5, (1.0, 1.0)), np.arange(1, 401), *white, 400)
    A, b, R = np.array([[1, dt], [0, 1]]), np.array([dt**2 / 2, dt]), np.diag([p, v])
    prior = solve_discrete_are(A.T, np.eye(2), 0.25 * np.outer(b, b), R)
    posterior = prior - prior @ np.linalg.solve(prior + R, prior)
    assert got[-1] == pytest.approx(np.full(3, posterior[0, 0]), rel=1e-9)


@cache
def bounded(dataset, seed):
    """A drive, its timeline, and its bound for every filter that reaches the end."""
    recording = dataset.load(seed)
    return recording, timeline(recording), bound(recording)


def mean_squares(model, seeds, dataset=FIELD):
    """Squared RMSE of each seed over the squared bound."""
    of_seeds = []
    for seed in seeds:
        recording, times, bound_m = bounded(dataset, seed)
        estimate = CompiledEngine().run(times, model, NoAdaptation())
        counted = counted_rows(estimate, recording, 5.0)
        of_seeds.append((PositionRmse().evaluate(estimate, recording, counted)["position_rmse_m"] / bound_m) ** 2)
    return np.array(of_seeds)


@pytest.mark.slow
def test_the_filter_with_the_true_noises_meets_it():
    ratios = mean_squares(Baseline(SIGMA), range(100))
    error = ratios.std(ddof=1) / np.sqrt(len(ratios))
    assert error < 0.03
    assert abs(ratios.mean() - 1) < 3 * error


@pytest.mark.slow
@pytest.mark.parametrize("model", [Baseline(0.05), Bias(SIGMA), Jerk(SIGMA)])
def test_no_other_filter_is_below_it(model):
    ratios = mean_squares(model, range(100))
    assert ratios.mean() > 1 + 3 * ratios.std(ddof=1) / np.sqrt(len(ratios))


def test_white_noise_taken_for_new_misses_the_bound_of_noise_that_lasts():
    assert mean_squares(Baseline(SIGMA), range(8), Field(duration_s=40.0)).mean() > 1.05


@pytest.mark.parametrize(
    "change",
    [
        {"ruts": True, "rut_times_s": (20.0,)},
        {"imu": "consumer"},
        {"silent": ("position",)},
        {"noise": False},
        {"accel_range_g": 1.0},
    ],
)
def test_there_is_none_where_the_noises_are_not_known(change):
    assert math.isnan(bound(dataclasses.replace(FIELD, **change).load(0)))


def test_fewer_fixes_know_less_and_there_is_no_bound_of_measurements_that_were_changed():
    recording = FIELD.load(0)
    assert math.isnan(bound(NoiseStep(times_s=(20.0,)).apply(recording, 0)))
    imu = dataclasses.replace(recording.imu, accel_mps2=recording.imu.accel_mps2 + 0.1)
    assert math.isnan(bound(dataclasses.replace(recording, imu=imu)))
    assert math.isnan(bound(dataclasses.replace(recording, drawn=None)))
    assert bound(dataclasses.replace(recording, velocity=None)) > bound(recording)
    assert bound(OUTAGE.apply(recording, 0)) > bound(recording)


def test_a_kept_recording_has_the_same(monkeypatch, tmp_path):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    first, kept = simulated(FIELD, 3), simulated(FIELD, 3)
    assert kept is not first
    assert bound(kept) == bound(first) == bound(FIELD.load(3))
