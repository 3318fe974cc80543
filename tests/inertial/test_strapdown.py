"""Rotations, the Earth and the mechanisation, against scipy and closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stepping import mechanise

from jerkbench.inertial.state import FLAT, RADIUS_M, RATE_RADPS, NavigationState, earth_at, gravity_enu, rotation_exp
from jerkbench.recording import GRAVITY_MPS2, Origin

AMES = Origin(42.0, -93.6, 300.0)


def at_rest(dcm=None, **parts):
    state = NavigationState(np.zeros(3), np.zeros(3), np.eye(3) if dcm is None else dcm, np.zeros(3), np.zeros(3))
    return state._replace(**parts)


@pytest.mark.parametrize("length", [0.0, 1e-9, 0.99e-4, 1.01e-4, 0.01, 1.0, 3.1])
def test_the_exponential_is_that_of_scipy(length):
    phi = length * np.array([0.48, -0.6, 0.64])

    np.testing.assert_allclose(rotation_exp(phi), Rotation.from_rotvec(phi).as_matrix(), atol=1e-15)


def test_circular_motion_comes_out_as_a_circle():
    radius, rate, dt, n = 20.0, 0.4, 0.005, 1000
    speed = radius * rate
    state = at_rest(velocity_mps=np.array([speed, 0.0, 0.0]))
    half = rate * dt / 2  # the mean of the force over an interval, in the body at its end, is shorter and turned
    force = np.array([0.0, speed * rate * np.sinc(half / np.pi) / np.cos(half), GRAVITY_MPS2])
    for _ in range(n):
        state, _, _ = mechanise(state, force, np.array([0.0, 0.0, rate]), dt, FLAT)
    angle = rate * dt * n

    np.testing.assert_allclose(state.velocity_mps, speed * np.array([np.cos(angle), np.sin(angle), 0.0]), atol=1e-9)
    circle = radius * np.array([np.sin(angle), 1.0 - np.cos(angle), 0.0])
    np.testing.assert_allclose(state.position_m, circle, atol=2e-5)
    np.testing.assert_allclose(state.dcm, Rotation.from_rotvec([0, 0, angle]).as_matrix(), atol=1e-12)


def test_a_body_at_rest_on_the_turning_earth_stays_at_rest():
    earth = earth_at(AMES, rotates=True, curved=False)
    C = Rotation.from_euler("ZYX", [0.5, 0.1, -0.2]).as_matrix()
    state = at_rest(C)
    for _ in range(1000):
        state, _, _ = mechanise(state, C.T @ [0, 0, GRAVITY_MPS2], C.T @ earth.rate_radps, 0.1, earth)

    np.testing.assert_allclose(state.dcm, C, atol=1e-10)
    np.testing.assert_allclose(state.velocity_mps, 0.0, atol=1e-9)


def test_a_free_body_is_turned_aside_as_coriolis_says():
    # free in the rotating frame, gravity held up: v' = -2 w x v, so v turns about w by -2 |w| t
    earth = earth_at(AMES, rotates=True, curved=False)
    state = at_rest(velocity_mps=np.array([100.0, 50.0, 20.0]))
    for _ in range(1000):
        force = state.dcm.T @ [0, 0, GRAVITY_MPS2]
        state, _, _ = mechanise(state, force, state.dcm.T @ earth.rate_radps, 0.1, earth)
    expected = Rotation.from_rotvec(-2.0 * earth.rate_radps * 100.0).apply([100.0, 50.0, 20.0])

    np.testing.assert_allclose(state.velocity_mps, expected, atol=1e-3)
    assert np.abs(expected - [100.0, 50.0, 20.0]).max() > 0.5


def test_the_earths_rate_is_that_of_the_latitude():
    rate = earth_at(AMES, rotates=True, curved=False).rate_radps

    assert np.linalg.norm(rate) == pytest.approx(RATE_RADPS)
    assert np.arctan2(rate[2], rate[1]) == pytest.approx(np.deg2rad(42.0))
    assert not earth_at(None, rotates=True, curved=False).rotates


def test_gravity_points_to_the_centre_of_the_earth():
    p = np.array([3000.0, -4000.0, 100.0])
    towards = -(p + np.array([0.0, 0.0, RADIUS_M]))
    exact = GRAVITY_MPS2 * RADIUS_M**2 * towards / np.linalg.norm(towards) ** 3

    np.testing.assert_allclose(gravity_enu(p, 1.0 / RADIUS_M), exact, atol=1e-5)
    np.testing.assert_array_equal(gravity_enu(p, 0.0), [0.0, 0.0, -GRAVITY_MPS2])
