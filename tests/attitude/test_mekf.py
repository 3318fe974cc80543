"""The multiplicative Kalman filter: its loop against matrix equations and closed forms, and its options."""

import numpy as np
import pytest
from moved import G, degrees_between, pushed, shaken, turning
from scipy.spatial.transform import Rotation

from jerkbench.attitude import common
from jerkbench.attitude.common import TiltStart
from jerkbench.attitude.mekf import Mekf, run_mekf


def with_full_matrices(plugin, imu, C, P):
    """The equations of the docstring, with a full gain matrix and a Joseph update."""
    b, a_prev, squares, x = np.zeros(3), np.zeros(3), [], []
    window = max(1, round(plugin.window_s / 0.01))
    for y_G, y_A in zip(imu.gyro_radps, imu.accel_mps2, strict=True):
        dt = 0.01
        step = Rotation.from_rotvec(dt * (y_G - b)).as_matrix()
        F = np.block([[step.T, -dt * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
        noise = [plugin.gyro_density**2] * 3 + [(plugin.bias_density if plugin.bias else 0.0) ** 2] * 3
        C, P = C @ step, F @ P @ F.T + dt * np.diag(noise)
        c = plugin.external_memory if plugin.adapt == "lee" else 0.0
        e = y_A - c * a_prev - G * C[2]
        H = np.hstack([G * np.cross(C[2], np.eye(3)).T, np.zeros((3, 3))])
        white = plugin.accel_density**2 / dt
        C0 = np.diag(H @ P @ H.T) + white
        squares = [*squares, e**2][-window:]
        many = max(1.0, plugin.window_s / dt)
        extra = np.zeros(3)
        if plugin.adapt == "mtf" and e @ e >= C0.sum():
            extra = many * np.maximum(np.mean(squares, axis=0) - C0, 0.0)
        if plugin.adapt == "scalar" and e @ e >= C0.sum():
            extra = many * np.full(3, (e @ e - C0.sum()) / 3)
        if plugin.adapt == "lee":
            extra = many * np.full(3, c**2 * (a_prev @ a_prev) / 3)
        M = np.diag(white + extra)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + M)
        dx, A = K @ e, np.eye(6) - K @ H
        P = A @ P @ A.T + K @ M @ K.T
        C, b = C @ Rotation.from_rotvec(dx[:3]).as_matrix(), b + dx[3:]
        a_prev = y_A - G * C[2]
        x.append(C[2])
    return np.array(x), b, P


PLUGINS = [
    *(Mekf(), Mekf(bias=False), Mekf("mtf", window_s=0.05), Mekf("scalar", window_s=0.05)),
    Mekf("lee", external_memory=0.5, window_s=0.1),
]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("plugin", PLUGINS)
def test_the_loop_agrees_with_the_equations(plugin, compiled):
    imu, C = shaken(400).imu, Rotation.from_euler("YX", [-0.2, 0.1]).as_matrix()
    sigma = 0.005 if plugin.bias else 0.0
    state = plugin.state(TiltStart(C[2], 0.03), 0.01)
    loop = common._compiled(run_mekf, "the attitude filter mekf") if compiled else run_mekf
    x, triggered = np.empty((400, 3)), np.empty(400, dtype=bool)
    loop(state, imu.gyro_radps.copy(), imu.accel_mps2.copy(), np.full(400, 0.01), x, triggered)
    expected, b, P = with_full_matrices(plugin, imu, C, np.diag([0.03] * 3 + [sigma**2] * 3))
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(state.b, b, rtol=0, atol=1e-9)
    np.testing.assert_allclose(state.P, P, rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(state.P, state.P.T)
    assert 0 < triggered.sum() < 400


@pytest.mark.parametrize("adapt", ["none", "mtf", "lee"])
def test_a_constant_rate_is_followed(adapt):
    drive, truth = turning([0.3, -0.2, 0.5])
    assert degrees_between(Mekf(adapt).verticals(drive)[0], truth).max() < 0.02


@pytest.mark.parametrize("plugin", [Mekf(), Mekf(bias=False), Mekf("lee", external_memory=0.5, window_s=0.2)])
def test_parameters_do_not_depend_on_the_sampling_rate(plugin):
    """The motion and the noise densities are the same."""
    drives = (pushed([1.0, 0.5, 0.0], 12.0, rate_hz=rate_hz) for rate_hz in (100.0, 400.0))
    ends = [plugin.verticals(drive)[0][-1] for drive in drives]
    assert degrees_between(*ends) < 0.1
    assert degrees_between(ends[0], [0.0, 0.0, 1.0]) > 0.5
