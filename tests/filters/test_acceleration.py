"""The filter without input, against closed forms."""

import numpy as np
from scipy.linalg import solve_discrete_are

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Acceleration
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest


def run(recording, accel):
    timeline = build_timeline(recording, level_attitude(recording, accel))
    return FilterpyEngine().run(timeline, Acceleration(), NoAdaptation())


def test_a_constant_acceleration_integrates_into_velocity_and_position():
    A, b, _ = Acceleration().axis_model(0.01, 0.01)
    state = np.linalg.matrix_power(A, 200) @ np.array([1.0, 2.0, 3.0])

    np.testing.assert_allclose(state, [1.0 + 2.0 * 2.0 + 1.5 * 2.0**2, 2.0 + 3.0 * 2.0, 3.0], rtol=1e-12)
    assert not b.any()


def test_the_variances_grow_as_sums_over_the_steps_say():
    # w of step i has worked for m = n - i + 1 steps: a = w, v = w dt m, p = w dt^2 m^2/2
    n, dt, sigma = 50, 0.02, 0.7
    A, _, Q = Acceleration(sigma).axis_model(dt, 0.01)
    P = np.zeros((3, 3))
    for _ in range(n):
        P = A @ P @ A.T + Q
    squares = n * (n + 1) * (2 * n + 1) / 6
    fourth = squares * (3 * n**2 + 3 * n - 1) / 5

    expected = sigma**2 * dt * np.array([dt**4 / 4 * fourth, dt**2 * squares, n])
    np.testing.assert_allclose(np.diag(P), expected, rtol=1e-12)


def test_the_covariance_settles_where_the_riccati_equation_says():
    estimate = run(recording_at_rest(duration_s=60.0, imu_rate_hz=5, gnss_rate_hz=5), (0.0, 0.0, 0.0))
    dt, sigma = 0.2, 2.0
    A = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    q, H, R = np.array([dt**2 / 2, dt, 1.0]), np.eye(2, 3), np.diag([0.01**2, 0.03**2])
    prior = solve_discrete_are(A.T, H.T, sigma**2 * dt * np.outer(q, q), R)
    posterior = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + R, H @ prior)

    np.testing.assert_allclose(estimate.covariance[-1][np.ix_([0, 3], [0, 3])], posterior[:2, :2], rtol=1e-8)


def test_the_imu_is_not_used():
    recording = recording_at_rest(duration_s=5.0)

    np.testing.assert_array_equal(
        run(recording, (0.0, 0.0, 0.0)).position_m, run(recording, (5.0, -3.0, 1.0)).position_m
    )
