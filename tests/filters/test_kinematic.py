"""Kinematic filters compared with closed forms and with each other, and the checks of their parameters."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench import api, plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.attitude.tilt import Tilt
from jerkbench.contracts import axis_models
from jerkbench.datasets.field import FieldWhite
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.errors import PluginError
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Baseline, Bias, Jerk, OptimisedKalmanFilter
from jerkbench.plugins import create
from jerkbench.recording import Position, Reference, Velocity
from jerkbench.testing import check_plugin
from jerkbench.timeline import INITIAL_SPEED_SIGMA_MPS, build_timeline
from synthetic import level_attitude, recording_at_rest

DT0 = 0.01
LENGTHS = [1e-9, 0.0007, 0.01, 0.0123, 0.5]


def noise(b, accel, h, walk):
    """White noise of the acceleration over the IMU interval, and the random walk of the last state."""
    Q = accel**2 * DT0 / h * np.outer(b, b)
    Q[-1, -1] += walk**2 * h
    return Q


EQUATIONS = {
    "baseline": lambda h: ([[1, h], [0, 1]], [h * h / 2, h], noise([h * h / 2, h], 0.2, h, 0)),
    "jerk": lambda h: (
        [[1, h, h**3 / 6], [0, 1, h * h / 2], [0, 0, 1]],
        [h * h / 2, h, 0],
        noise([h * h / 2, h, 0], 0.1, h, 6.0),
    ),
    "bias": lambda h: (
        [[1, h, h * h / 2], [0, 1, h], [0, 0, 1]],
        [h * h / 2, h, 0],
        noise([h * h / 2, h, 0], 0.1, h, 0.03),
    ),
    "acceleration": lambda h: (
        [[1, h, h * h / 2], [0, 1, h], [0, 0, 1]],
        [0, 0, 0],
        2.0**2 * h * np.outer([h * h / 2, h, 1], [h * h / 2, h, 1]),
    ),
    "constant_velocity": lambda h: ([[1, h], [0, 1]], [0, 0], [[h**3 / 3, h * h / 2], [h * h / 2, h]]),
}


@pytest.mark.parametrize("name", EQUATIONS)
def test_each_model_agrees_with_its_equations(name):
    A, b, Q = axis_models(create("filter", {"name": name}), np.array([0.0, *LENGTHS]), DT0)

    assert (A[0] == np.eye(len(A[0]))).all()
    assert not b[0].any()
    for row, h in enumerate(LENGTHS, start=1):
        expected_A, expected_b, expected_Q = EQUATIONS[name](h)
        np.testing.assert_allclose(A[row], expected_A, rtol=1e-14)
        np.testing.assert_allclose(b[row], expected_b, rtol=1e-14)
        np.testing.assert_allclose(Q[row], expected_Q, rtol=1e-13)


@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_it_equals_the_baseline_for_one_setting(dt):
    model = OptimisedKalmanFilter(0.5 * 0.3 * dt**1.5, 0.3 * dt**0.5, 1.0)  # the Q of one full step is the baseline's
    ours, theirs = model.axis_model(dt, dt), Baseline(0.3).axis_model(dt, dt)

    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_the_noise_is_a_covariance_that_grows_with_time_and_nearly_that_of_the_baseline():
    model = OptimisedKalmanFilter(0.02, 0.3, -0.6)
    Q = model.axis_model(0.01, 0.01)[2]
    np.testing.assert_allclose(Q, 0.01 * np.array([[0.02**2, -0.6 * 0.02 * 0.3], [-0.6 * 0.02 * 0.3, 0.3**2]]))
    np.testing.assert_allclose(model.axis_model(0.004, 0.01)[2] + model.axis_model(0.006, 0.01)[2], Q)
    assert np.linalg.eigvalsh(Q)[0] > 0
    error = {
        name: api.run(dataset={"name": "field_white", "duration_s": 30.0}, filter=name, seeds=2)["position_rmse_m"]
        for name in ("okf", "baseline")
    }
    np.testing.assert_allclose(error["okf"], error["baseline"], rtol=1e-3)
    check_plugin("filter", OptimisedKalmanFilter())
    for wrong in ({"correlation": 1.1}, {"position_walk_m_per_sqrt_s": -1.0}):
        with pytest.raises(PluginError, match="okf"):
            OptimisedKalmanFilter(**wrong)


FIX_M = np.array([1.0, 2.0, 3.0])
R_P_M2, R_V_M2PS2 = 0.04, 0.25


def estimate_at(*stamps_s):
    """Two fixes up to 0.1 s, then one velocity without an up axis at 0.5 s."""
    recording = recording_at_rest(
        duration_s=1.0,
        position=Position([0.05, 0.1], [2 * FIX_M, FIX_M], np.tile(R_P_M2 * np.eye(3), (2, 1, 1))),
        velocity=Velocity([0.5], [[2.0, -1.0, np.nan]], R_V_M2PS2 * np.eye(3)[None]),
        reference=Reference(stamps_s, "made by hand", independent=True, enu_m=np.zeros((len(stamps_s), 3))),
    )
    return GnssOnly().estimate(recording, level_attitude(recording), NoAdaptation())


def test_before_the_first_velocity_the_position_is_constant_and_its_covariance_large():
    estimate = estimate_at(0.1, 0.3)
    variance = INITIAL_SPEED_SIGMA_MPS**2

    np.testing.assert_array_equal(estimate.position_m, [FIX_M, FIX_M])
    np.testing.assert_array_equal(estimate.velocity_mps, np.zeros((2, 3)))
    np.testing.assert_allclose(np.diag(estimate.covariance[0]), [R_P_M2] * 3 + [variance] * 3)
    np.testing.assert_allclose(np.diag(estimate.covariance[1])[:3], R_P_M2 + variance * 0.2**2)


def test_after_the_first_velocity_each_axis_is_extrapolated():
    estimate = estimate_at(0.5, 0.9)

    np.testing.assert_allclose(estimate.velocity_mps, [[2.0, -1.0, 0.0]] * 2)
    np.testing.assert_allclose(estimate.position_m, FIX_M + np.outer([0.4, 0.8], [2.0, -1.0, 0.0]))
    np.testing.assert_allclose(np.diag(estimate.covariance[1])[:2], R_P_M2 + R_V_M2PS2 * 0.8**2)
    np.testing.assert_allclose(estimate.covariance[1][0, 3], R_V_M2PS2 * 0.8)
    np.testing.assert_allclose(estimate.covariance[1][2, 2], R_P_M2 + INITIAL_SPEED_SIGMA_MPS**2 * 0.8**2)


def test_jerk_and_bias_agree_to_a_millimetre_on_the_nominal_field():
    recording = FieldWhite().load(0)
    timeline = build_timeline(recording, Tilt().estimate(recording))
    jerk, bias, baseline = (
        CompiledEngine().run(timeline, model, NoAdaptation()).position_m for model in (Jerk(), Bias(), Baseline())
    )

    assert np.linalg.norm(jerk - bias, axis=1).max() < 1e-3
    assert np.linalg.norm(jerk - baseline, axis=1).max() > 1e-2


def test_a_time_may_be_infinite():
    """A bias with an infinite correlation time is constant."""
    model = plugins.create("filter", {"name": "eskf15", "gyro_correlation_s": math.inf})
    assert model.sensor_noise().gyro_bias == 0.0


SIGMA_A_MPS2 = FieldWhite().accel_sigma_mps2
"""The only error of u with the true attitude: white noise that is equal on all axes, so rotations do not change it."""


@pytest.fixture(scope="module")
def drives():
    return [FieldWhite(duration_s=60.0).load(seed) for seed in range(6)]


def squares(recording, attitude):
    """NEES of position and velocity every 5 s after 10 s; the errors are correlated over about 1.5 s."""
    timeline = build_timeline(recording, attitude.estimate(recording))
    estimate = CompiledEngine().run(timeline, Baseline(accel_mps2=SIGMA_A_MPS2), NoAdaptation())
    truth = recording.reference
    rows = np.searchsorted(truth.t_s[estimate.index], np.arange(10.0, 60.1, 5.0) - 1e-6)
    true = np.hstack([truth.enu_m, truth.velocity_mps])[estimate.index[rows]]
    error = true - np.hstack([estimate.position_m, estimate.velocity_mps])[rows]
    return [e @ np.linalg.solve(P, e) for e, P in zip(error, estimate.covariance[rows], strict=True)]


def test_nees_lies_in_the_band_with_the_true_attitude_but_not_if_gravity_leaks(drives):
    values = np.concatenate([squares(drive, ReferenceAttitude()) for drive in drives])
    low, high = chi2.ppf([0.025, 0.975], 6 * len(values)) / len(values)
    assert len(values) == 66
    assert low < values.mean() < high
    assert np.mean([squares(drive, Tilt()) for drive in drives[:2]]) > 50.0
