"""The tilt filter: reference values, its equations, and their properties."""

import itertools
import json

import numpy as np
import pytest
from moved import G
from scipy.linalg import expm

from jerkbench.attitude import common
from jerkbench.attitude.common import ADAPTATIONS, TiltStart
from jerkbench.attitude.tilt import PROPAGATIONS, Tilt, run_tilt
from jerkbench.geometry import dcm_from_euler, roll_pitch

LEVEL = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def golden(shared_folder):
    return json.loads((shared_folder / "reference" / "golden.json").read_text())


def compiled():
    return common._compiled(run_tilt, "the tilt filter")


def after(samples, p, x=LEVEL, P=None, a_prev=(0.0, 0.0, 0.0), loop=run_tilt):
    """State, update, x and triggers of the loop after ``samples`` (gyro, accel, dt)."""
    n = len(samples[2])
    state, path, flags = p.state(TiltStart(np.array(x), 0.03)), np.empty((n, 3)), np.empty(n, dtype=bool)
    state.P[:] = 0.03 * np.eye(3) if P is None else P
    state.gravity.a_prev[:] = a_prev
    loop(state, *samples, path, flags)
    return state, state.gravity, path, flags


@pytest.mark.parametrize("loop", [lambda: run_tilt, compiled], ids=["uncompiled", "compiled"])
@pytest.mark.parametrize("name", ["tilt_mtf_triggered", "tilt_none"])
def test_one_step_equals_the_reference_values(name, loop, golden):
    given, expected = golden[name]["inputs"], golden[name]["outputs"]
    p = Tilt(given["adapt"], given["sigma_G"], given["sigma_A"], given["c_a"], normalise=given["normalise"])
    samples = np.array([given["y_G"]]), np.array([given["y_A"]]), np.array([given["dt"]])
    state, update, _, (triggered,) = after(samples, p, given["x"], given["P"], given["a_prev"], loop())
    roll, pitch = roll_pitch(state.x)
    got = {
        "innovation": update.e,
        "sigma_acc": update.M - p.sigma_accel_mps2**2,
        "x": state.x,
        "P": state.P,
        "a_ext": update.a_prev,
        "roll": roll,
        "pitch": pitch,
        "P_prior": (np.diag(expected["P_prior"]), (update.C0 - p.sigma_accel_mps2**2) / G**2),
    }
    assert triggered == expected["triggered"]
    assert got.keys() == expected.keys() - {"triggered", "x_prior"}  # x_prior follows from e and x
    prior = got.pop("P_prior")
    np.testing.assert_allclose(*prior, rtol=0, atol=1e-10)
    for key, value in got.items():
        np.testing.assert_allclose(value, expected[key], rtol=0, atol=1e-10, err_msg=key)


def skew(v):
    return np.cross(v, np.eye(3)).T  # columns v x e_i


def tilt_by_equations(x, P, gyro, accel, dt, p):
    """x (n, 3) and the triggers (n,) of a run, with full matrices and the exponential and inverse of SciPy."""
    a_prev, squares, path, flags, H = np.zeros(3), [], [], [], G * np.eye(3)
    for y_G, y_A, step in zip(gyro, accel, dt, strict=True):
        Phi = expm(-step * skew(y_G)) if p.propagation == "exact" else np.eye(3) - step * skew(y_G)
        Q = -(step**2) * skew(x) @ (p.sigma_gyro_radps**2 * np.eye(3)) @ skew(x)
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
        e = y_A - p.external_memory * a_prev - G * x
        squares.append(e**2)
        C0 = G**2 * P + p.sigma_accel_mps2**2 * np.eye(3)
        triggered = bool(np.sum(e**2) >= np.trace(C0))
        Sigma = np.zeros((3, 3))
        if p.adapt == "mtf" and triggered:
            w = np.mean(squares[-p.window :], axis=0)
            Sigma = np.diag([max(0.0, w[i] - C0[i, i]) for i in range(3)])
        if p.adapt == "scalar" and triggered:
            Sigma = np.eye(3) * (np.sum(e**2) - np.trace(C0)) / 3
        if p.adapt == "lee":
            Sigma = np.eye(3) * p.external_memory**2 * np.linalg.norm(a_prev) ** 2 / 3
        M = p.sigma_accel_mps2**2 * np.eye(3) + Sigma
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + M)
        rest = np.eye(3) - K @ H
        x, P = x + K @ e, rest @ P @ rest.T + K @ M @ K.T
        x = x / np.linalg.norm(x) if p.normalise else x
        a_prev = y_A - G * x
        path.append(x)
        flags.append(triggered)
    return np.array(path), np.array(flags)


def shaken(n, seed=0):
    """A rotating, shaken IMU with irregular intervals. It is quiet at first, so only some samples trigger."""
    rng = np.random.default_rng(seed)
    gyro = 0.3 * rng.normal(size=(n, 3))
    gyro[7] = 0.0
    accel = G * LEVEL + 0.02 * rng.normal(size=(n, 3))
    accel[n // 3 :] += rng.normal(size=3) * (rng.random((n - n // 3, 1)) < 0.4)
    return gyro, accel, rng.uniform(0.005, 0.02, n)


@pytest.mark.parametrize("adapt", ADAPTATIONS)
@pytest.mark.parametrize("propagation", PROPAGATIONS)
def test_a_run_agrees_with_the_equations(adapt, propagation):
    samples = shaken(80)
    for window, memory, normalise in itertools.product((1, 4), (0.0, 0.6), (True, False)):
        if adapt == "lee" and not memory:
            continue
        p = Tilt(adapt, 0.05, 0.3, memory, window, normalise, propagation)
        *_, x, triggered = after(samples, p, loop=compiled())
        wanted_x, wanted_triggered = tilt_by_equations(LEVEL, 0.03 * np.eye(3), *samples, p)
        np.testing.assert_allclose(x, wanted_x, rtol=0, atol=1e-11)
        np.testing.assert_array_equal(triggered, wanted_triggered)
        assert 0 < triggered.sum() < 80


def naive_dcm(roll, pitch, yaw):
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return Rz @ Ry @ Rx


@pytest.mark.parametrize("compensation", ["midpoint", "endpoint"])
def test_gravity_is_compensated_sample_by_sample(compensation):
    euler = np.array([[0.1, -0.2, 0.3], [0.2, 0.1, 0.5], [-0.1, 0.0, 3.0]])
    force = np.array([[0.5, 0.2, 9.9], [-0.3, 0.4, 9.7], [1.0, 0.0, 9.81]])
    Omega = [naive_dcm(*each) for each in euler]
    expected = []
    for k in range(3):
        turn = (Omega[k - 1] + Omega[k]) / 2 if compensation == "midpoint" and k else Omega[k]
        expected.append(turn @ force[k] - [0, 0, 9.81])
    got = common.compensate_gravity(dcm_from_euler(euler), force, compensation)
    np.testing.assert_allclose(got, expected, atol=1e-14)
