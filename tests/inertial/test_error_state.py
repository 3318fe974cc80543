"""Every derivative of the error state, against differences of the functions themselves."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from stepping import mechanise, transition

from jerkbench.inertial.state import FLAT, NavigationState, SensorNoise, calibrated, corrected, process_noise
from jerkbench.inertial.update import (
    heading,
    point_in_enu,
    reset,
    transformed,
    velocity_in_body,
    wheel_speed,
)
from jerkbench.recording import GRAVITY_MPS2

NOISE = SensorNoise(angle=3e-6, velocity=1e-3, gyro_bias=2e-9, accel_bias=4e-7)
ARM = np.array([0.7, -0.3, 1.2])
GYRO = np.array([0.3, -0.2, 0.5])
STATE = NavigationState(
    np.array([10.0, -20.0, 3.0]),
    np.array([5.0, 2.0, -0.5]),
    Rotation.from_euler("ZYX", [2.0, 0.2, -0.3]).as_matrix(),
    np.array([0.01, -0.02, 0.005]),
    np.array([0.1, 0.05, -0.2]),
)
WORN = STATE._replace(wheel_scale=0.03)


def difference(after, before):
    """The error state that takes ``before`` to ``after``."""
    turn = Rotation.from_matrix(after.dcm @ before.dcm.T).as_rotvec()
    return np.concatenate(
        [
            after.position_m - before.position_m,
            after.velocity_mps - before.velocity_mps,
            turn,
            after.gyro_bias_radps - before.gyro_bias_radps,
            after.accel_bias_mps2 - before.accel_bias_mps2,
            [] if after.wheel_scale is None else [after.wheel_scale - before.wheel_scale],
        ]
    )


def derivative(function, rows, step=1e-5, states=15, about=STATE, retracted=corrected):
    """Central differences of ``function`` over the error state."""
    H = np.empty((rows, states))
    for i, dx in enumerate(step * np.eye(states)):
        H[:, i] = (function(retracted(about, dx)) - function(retracted(about, -dx))) / (2 * step)
    return H


@pytest.mark.parametrize(("about", "states"), [(STATE, 15), (WORN, 16)])
def test_a_small_correction_is_put_in_as_the_error_state_defines_it(about, states):
    dx = 1e-6 * np.arange(1.0, states + 1.0)

    np.testing.assert_allclose(difference(corrected(about, dx), about), dx, atol=2e-8)


def held_up(state, sensed):
    """What the state makes, in ENU, of a force that the accelerometer shows at rest."""
    return state.dcm @ calibrated(state, sensed, GYRO)[0]


UP_BODY = STATE.dcm.T @ [0.0, 0.0, GRAVITY_MPS2]


def test_a_large_correction_changes_the_force_that_holds_up_as_the_linear_filter_says():
    dx = np.zeros(15)
    dx[6:9], dx[12:15] = [0.03, -0.02, 0.05], [0.3, -0.2, 0.1]
    sensed, up = UP_BODY + STATE.accel_bias_mps2, np.array([0.0, 0.0, GRAVITY_MPS2])

    expected = up + np.cross(dx[6:9], up) - STATE.dcm @ dx[12:15]
    np.testing.assert_allclose(held_up(corrected(STATE, dx), sensed), expected, atol=1e-9)


def test_an_error_beside_a_correction_has_the_numbers_of_the_new_state():
    dx = 1e-3 * np.sin(np.arange(1.0, 16.0))
    dx[12:15] = STATE.dcm.T @ np.cross(dx[6:9], STATE.dcm @ UP_BODY)  # what held it up holds it up
    after = corrected(STATE, dx)
    numeric = derivative(lambda s: difference(s, after), 15, retracted=lambda s, e: corrected(s, dx + e))
    G = reset(STATE, after, dx[6:9])
    P = np.diag(np.arange(1.0, 16.0))

    np.testing.assert_allclose(G, numeric, atol=2e-4)
    assert np.abs(G - np.eye(15)).max() > 2e-3
    np.testing.assert_allclose(transformed(P, G), G @ P @ G.T, atol=1e-12)


def test_phi_is_the_derivative_of_the_mechanisation():
    dt, accel = 0.01, np.array([1.0, -2.0, 9.0])
    after, mean, force = mechanise(STATE, accel, GYRO, dt, FLAT)
    numeric = derivative(lambda s: difference(mechanise(s, accel, GYRO, dt, FLAT)[0], after), 15)

    # first-order blocks to 1e-3 of themselves, what is left of the second order in dt absolutely
    np.testing.assert_allclose(transition(dt, mean, force), numeric, rtol=1e-3, atol=2e-6)


def test_phi_over_a_longer_step_is_the_matrix_exponential():
    dt, C, force = 0.5, STATE.dcm, np.array([1.0, -2.0, 12.0])
    a = np.array([[0, -force[2], force[1]], [force[2], 0, -force[0]], [-force[1], force[0], 0]])
    F = np.zeros((15, 15))
    F[:3, 3:6], F[3:6, 6:9], F[3:6, 12:], F[6:9, 9:12] = np.eye(3), -a, -C, -C

    np.testing.assert_allclose(transition(dt, C, force), expm(F * dt), atol=1e-12)


def test_the_noise_of_two_halves_is_that_of_the_whole():
    whole, half = process_noise(NOISE, 0.02), process_noise(NOISE, 0.01)
    Phi = np.eye(15)
    Phi[:3, 3:6] = 0.01 * np.eye(3)

    np.testing.assert_allclose(Phi @ half @ Phi.T + half, whole, atol=1e-18)


def rate_of(state):
    return GYRO - state.gyro_bias_radps


@pytest.mark.parametrize("arm", [ARM, np.zeros(3)])
def test_position_and_velocity_of_a_point_and_their_derivative(arm):
    h, H = point_in_enu(STATE, rate_of(STATE), arm)
    C = STATE.dcm

    np.testing.assert_allclose(h[:3], STATE.position_m + C @ arm)
    np.testing.assert_allclose(h[3:], STATE.velocity_mps + C @ np.cross(rate_of(STATE), arm))
    np.testing.assert_allclose(H, derivative(lambda s: point_in_enu(s, rate_of(s), arm)[0], 6), atol=1e-8)


def test_velocity_in_the_body_and_its_derivative():
    h, H = velocity_in_body(STATE, rate_of(STATE), ARM)

    np.testing.assert_allclose(STATE.dcm @ h, point_in_enu(STATE, rate_of(STATE), ARM)[0][3:])
    np.testing.assert_allclose(H, derivative(lambda s: velocity_in_body(s, rate_of(s), ARM)[0], 3), atol=1e-8)


def test_the_speed_of_a_wheel_of_another_size_and_its_derivative():
    h, H = wheel_speed(WORN, rate_of(STATE), ARM)
    u = velocity_in_body(STATE, rate_of(STATE), ARM)[0]

    np.testing.assert_allclose(h, u * [1.03, 1.0, 1.0])

    def shown(state):
        return wheel_speed(state._replace(wheel_scale=0.03 + state.wheel_scale), rate_of(state), ARM)[0]

    unworn = STATE._replace(wheel_scale=0.0)
    np.testing.assert_allclose(H, derivative(shown, 3, states=16, about=unworn), atol=1e-8)


def test_heading_and_its_derivative():
    yaw, H = heading(STATE)

    assert yaw == pytest.approx(2.0)
    np.testing.assert_allclose(H, derivative(lambda s: np.array([heading(s)[0]]), 1), atol=1e-8)
