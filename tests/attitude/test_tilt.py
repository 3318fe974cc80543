import itertools
import json
import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from jerkbench.attitude.external_acceleration import ADAPTATIONS
from jerkbench.attitude.tilt import TiltParameters, TiltState, roll_pitch, run_tilt, start_state, tilt_step, transition

G = 9.81
LEVEL = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def golden(shared_folder):
    return json.loads((shared_folder / "reference" / "golden.json").read_text())


@pytest.mark.parametrize("name", ["tilt_mtf_triggered", "tilt_none"])
def test_one_step_equals_the_reference_values(name, golden):
    given, wanted = golden[name]["inputs"], golden[name]["outputs"]
    parameters = TiltParameters(
        given["sigma_G"], given["sigma_A"], given["c_a"], normalise=given["normalise"], adapt=given["adapt"]
    )
    before = TiltState(*(np.array(given[key]) for key in ("x", "P", "a_prev")), np.empty((0, 3)))
    step = tilt_step(before, np.array(given["y_G"]), np.array(given["y_A"]), given["dt"], parameters)
    roll, pitch = roll_pitch(step.state.x)
    got = {
        "x_prior": step.x_prior,
        "P_prior": step.P_prior,
        "innovation": step.innovation,
        "sigma_acc": step.sigma_acc,
        "x": step.state.x,
        "P": step.state.P,
        "a_ext": step.state.a_prev,
        "roll": roll,
        "pitch": pitch,
    }
    assert step.triggered is wanted.pop("triggered")
    assert got.keys() == wanted.keys()
    for key, value in wanted.items():
        np.testing.assert_allclose(got[key], value, rtol=0, atol=1e-10, err_msg=key)


def skew(v):
    return np.cross(v, np.eye(3)).T  # columns v x e_i


def naive_run(x, P, gyro, accel, dt, p):
    """The equations one by one, with whole matrices and the library's inverse."""
    a_prev, squares, out = np.zeros(3), [], []
    for y_G, y_A in zip(gyro, accel, strict=True):
        Phi = expm(-dt * skew(y_G)) if p.exact else np.eye(3) - dt * skew(y_G)
        Q = -(dt**2) * skew(x) @ (p.sigma_gyro_radps**2 * np.eye(3)) @ skew(x)
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
        e = y_A - p.external_memory * a_prev - G * x
        squares.append(e**2)
        C0 = G**2 * P + p.sigma_accel_mps2**2 * np.eye(3)
        hit = np.sum(e**2) >= np.trace(C0)
        Sigma = np.zeros((3, 3))
        if p.adapt == "mtf" and hit:
            w = np.mean(squares[-p.window :], axis=0)
            Sigma = np.diag([max(0.0, w[i] - C0[i, i]) for i in range(3)])
        if p.adapt == "scalar" and hit:
            Sigma = np.eye(3) * (np.sum(e**2) - np.trace(C0)) / 3
        if p.adapt == "lee":
            Sigma = np.eye(3) * p.external_memory**2 * np.linalg.norm(a_prev) ** 2 / 3
        M = p.sigma_accel_mps2**2 * np.eye(3) + Sigma
        H = G * np.eye(3)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + M)
        x = x + K @ e
        P = (np.eye(3) - K @ H) @ P @ (np.eye(3) - K @ H).T + K @ M @ K.T
        P = (P + P.T) / 2
        if p.normalise:
            x = x / np.linalg.norm(x)
        a_prev = y_A - G * x
        out.append((x, hit))
    return np.array([x for x, _ in out]), np.array([hit for _, hit in out])


def shaken(n, seed=0):
    """A turning, shaken IMU: quiet at first, so that it triggers now and then only."""
    rng = np.random.default_rng(seed)
    gyro = 0.3 * rng.normal(size=(n, 3))
    accel = G * LEVEL + 0.02 * rng.normal(size=(n, 3))
    accel[n // 3 :] += rng.normal(size=3) * (rng.random((n - n // 3, 1)) < 0.4)
    return gyro, accel


@pytest.mark.parametrize("adapt", ADAPTATIONS)
@pytest.mark.parametrize("exact", [False, True])
def test_a_run_equals_the_naive_equations(adapt, exact):
    gyro, accel = shaken(80)
    for window, memory, normalise in itertools.product((1, 4), (0.0, 0.6), (True, False)):
        p = TiltParameters(0.05, 0.3, memory, window, normalise, exact, adapt)
        x, triggered = run_tilt(start_state(LEVEL, 0.03), gyro, accel, np.full(80, 0.01), p)
        wanted_x, wanted_triggered = naive_run(LEVEL, 0.03 * np.eye(3), gyro, accel, 0.01, p)
        np.testing.assert_allclose(x, wanted_x, rtol=0, atol=1e-11)
        np.testing.assert_array_equal(triggered, wanted_triggered)
        assert 0 < triggered.sum() < 80


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 1e-3, 2.0])
def test_exact_transition_is_the_inverse_rotation(angle_rad):
    turn = angle_rad * np.array([0.6, 0.0, -0.8])
    np.testing.assert_allclose(transition(turn, exact=True), Rotation.from_rotvec(-turn).as_matrix(), atol=1e-15)


def test_exact_propagation_follows_a_fast_constant_rotation():
    # The accelerometer counts for nothing here, so that the gyro alone carries the tilt.
    rate, dt, n = np.array([9.0, -20.0, 11.0]), 1 / 285.71, 2000
    p = TiltParameters(sigma_accel_mps2=1e9, exact=True, adapt="none")
    x, _ = run_tilt(start_state(LEVEL, 1e-3), np.tile(rate, (n, 1)), np.zeros((n, 3)), np.full(n, dt), p)
    truth = Rotation.from_rotvec(rate * dt * np.arange(1, n + 1)[:, None]).inv().apply(LEVEL)
    np.testing.assert_allclose(x, truth, atol=1e-10)


def accelerating(adapt, rest, moving):
    """Pitch and trigger of a level robot that rests, then accelerates forwards with 1 m/s2."""
    n = rest + moving
    accel = np.tile([1.0, 0.0, G], (n, 1))
    accel[:rest, 0] = 0.0
    p = TiltParameters(adapt=adapt, sigma_accel_mps2=0.02)
    x, triggered = run_tilt(start_state(LEVEL, 1e-3), np.zeros((n, 3)), accel, np.full(n, 0.01), p)
    return roll_pitch(x)[1], triggered


def test_mtf_keeps_a_level_robot_level_while_it_accelerates():
    rest, moving, q = 800, 500, (0.01 * 0.0017) ** 2
    pitch, triggered = accelerating("mtf", rest, moving)
    np.testing.assert_array_equal(triggered, np.arange(rest + moving) >= rest)
    # With S = e^2 a step moves x by g P/e. P starts from its steady value at rest and grows by q a sample.
    steady = math.sqrt(q) * 0.02 / G
    drift = G * (moving * steady + q * moving**2 / 2) / 1.0
    assert -pitch[-1] == pytest.approx(drift, rel=0.02)
    assert drift < 0.01 * math.atan2(1.0, G)


def test_without_adaptation_the_tilt_goes_to_the_apparent_vertical():
    pitch, _ = accelerating("none", 200, 3000)
    assert pitch[-1] == pytest.approx(-math.atan2(1.0, G), abs=1e-4)


@pytest.mark.parametrize("adapt", ADAPTATIONS)
def test_external_variance_is_never_negative_and_x_has_length_one(adapt):
    gyro, accel = shaken(300, seed=1)
    p = TiltParameters(sigma_accel_mps2=0.3, external_memory=0.6, window=3, adapt=adapt)
    state = start_state(LEVEL, 1e-3)
    for y_G, y_A in zip(gyro, accel, strict=True):
        step = tilt_step(state, y_G, y_A, 0.01, p)
        state = step.state
        assert (step.sigma_acc >= 0).all()
        assert np.linalg.norm(state.x) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_array_equal(state.P, state.P.T)


def test_after_mtf_no_axis_lies_outside_its_own_variance():
    gyro, accel = shaken(300, seed=2)
    p, state, hits = TiltParameters(sigma_accel_mps2=0.1), start_state(LEVEL, 1e-3), 0
    for y_G, y_A in zip(gyro, accel, strict=True):
        step = tilt_step(state, y_G, y_A, 0.01, p)
        if step.triggered:
            S = G**2 * step.P_prior.diagonal() + p.sigma_accel_mps2**2 + step.sigma_acc
            assert (step.innovation**2 <= S * (1 + 1e-12)).all()
            hits += 1
        state = step.state
    assert hits > 10


def test_a_step_does_not_change_its_arguments():
    state = start_state(LEVEL, 1e-3)
    before = [array.copy() for array in state]
    tilt_step(state, np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 9.0]), 0.01, TiltParameters(window=3))
    for array, copy in zip(state, before, strict=True):
        np.testing.assert_array_equal(array, copy)
