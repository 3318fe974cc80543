"""Interacting multiple models against filterpy, and in cases with a known result."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation, Oracle
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest, with_fix_noise


def noisy_recording(seed=1, **options):
    """A body at rest, with measurement noise as reported and with a varying input."""
    recording, rng = with_fix_noise(recording_at_rest(**options), seed), np.random.default_rng(seed + 1)
    t = recording.imu.t_s
    u = np.column_stack([0.3 * np.sin(t), np.where(t > t[-1] / 2, 2.0, 0.0), 0.05 * rng.normal(size=len(t))])
    return recording, level_attitude(recording, u)


def filterpy_filter(model, timeline, extra=None):
    """A filterpy filter for one step length, with its matrices built axis by axis."""
    dt = float(timeline.dt_s[1])
    A, b, Q = model.axis_model(dt, timeline.dt0_s)
    if extra is not None:
        A, b = np.block([[A, np.zeros((2, 1))], [np.zeros((1, 2)), np.eye(1)]]), np.append(b, 0.0)
        Q = np.pad(Q, ((0, 1), (0, 1)))
    kf = KalmanFilter(dim_x=9, dim_z=6, dim_u=3)
    kf.F, kf.B, kf.Q = np.zeros((9, 9)), np.zeros((9, 3)), np.zeros((9, 9))
    for axis in range(3):
        rows = np.arange(3) * 3 + axis
        kf.F[np.ix_(rows, rows)], kf.Q[np.ix_(rows, rows)], kf.B[rows, axis] = A, Q, b
    kf.H = np.eye(6, 9)
    kf.x = np.append(timeline.x0, np.zeros(3))[:, None]
    kf.P = np.diag(np.append(np.diag(timeline.P0), np.full(3, 400.0)))
    return kf


def test_it_agrees_with_filterpy_if_each_step_has_an_update():
    recording, attitude = noisy_recording(duration_s=12.0, imu_rate_hz=5, gnss_rate_hz=5)
    timeline = build_timeline(recording, attitude)
    filters = [filterpy_filter(Baseline(0.2), timeline, extra=400.0), filterpy_filter(Jerk(), timeline)]
    imm = IMMEstimator(filters, [0.7, 0.3], np.array([[0.9, 0.1], [0.2, 0.8]]))
    expected = []
    for sample, update in zip(timeline.sample[1:], timeline.update[1:], strict=True):
        imm.predict(timeline.accel_enu_mps2[sample][:, None])
        for kf in filters:
            kf.R = timeline.measurements.R[update]
        imm.update(timeline.measurements.z[update][:, None])
        expected.append((imm.x[:6, 0].copy(), imm.P[:6, :6].copy()))

    model = InteractingMultipleModels(first_stays=0.9, second_stays=0.8, first_probability=0.7)
    estimate = model.estimate(recording, attitude, NoAdaptation())
    np.testing.assert_allclose(estimate.position_m[1:], [x[:3] for x, _ in expected], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(estimate.velocity_mps[1:], [x[3:] for x, _ in expected], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(estimate.covariance[1:], [P for _, P in expected], rtol=1e-8, atol=1e-13)


@pytest.mark.parametrize("adaptation", [NoAdaptation(), Mtf(), Oracle()])
def test_two_equal_models_equal_the_single_model_with_absent_rows(adaptation):
    recording, attitude = noisy_recording(duration_s=10.0)
    masked = recording.velocity.mps.copy()
    masked[10:20], masked[20:, 2] = np.nan, np.nan
    fixes = replace(recording.position, true_covariance_m2=9.0 * recording.position.covariance_m2)
    recording = replace(recording, velocity=replace(recording.velocity, mps=masked), position=fixes)
    single = FilterpyEngine().run(build_timeline(recording, attitude), Baseline(0.3), adaptation)
    twice = InteractingMultipleModels("baseline", "baseline", first_accel_mps2=0.3, second_accel_mps2=0.3)
    estimate = twice.estimate(recording, attitude, adaptation)

    np.testing.assert_allclose(estimate.position_m, single.position_m, atol=1e-10)
    np.testing.assert_allclose(estimate.covariance, single.covariance, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(estimate.updates.nis, single.updates.nis, rtol=1e-8)
    np.testing.assert_allclose(estimate.updates.innovation, single.updates.innovation, atol=1e-10)
    np.testing.assert_allclose(estimate.updates.R_diagonal, single.updates.R_diagonal, rtol=1e-8)


def test_invalid_models_and_probabilities_raise():
    with pytest.raises(PluginError, match=r"cannot mix jerk with bias"):
        InteractingMultipleModels("jerk", "bias")
    with pytest.raises(PluginError, match="Did you mean 'jerk'"):
        InteractingMultipleModels(second="jrk")
    with pytest.raises(PluginError, match="first_stays"):
        InteractingMultipleModels(first_stays=1.0)
