"""The invariant error, against matrices of the group SE_2(3) and against what Hartley et al. write."""

from dataclasses import replace

import numpy as np
import pytest
from invariant_oracle import GRAVITY, InvariantFilter, cross_matrix, exp, group, log
from scipy.spatial.transform import Rotation
from stepping import transition
from test_error_state import STATE, WORN, derivative, difference

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.filters.eskf15 import InvariantEkf
from jerkbench.inertial.state import FLAT, advance_navigation
from jerkbench.inertial.update import corrected_on_group

LARGE = np.array([40.0, -25.0, 9.0, 3.0, -6.0, 2.0, 0.9, -0.6, 1.1])
"""dp, dv, phi: an error far beyond what is linear."""


def numbers(state):
    """T (9, 9) by differences: from the additive error to xi."""
    return derivative(lambda s: log(group(s) @ np.linalg.inv(group(state))), 9, about=state, states=15)[:, :9]


def with_error(state, xi):
    X = exp(xi) @ group(state)
    return state._replace(position_m=X[:3, 4], velocity_mps=X[:3, 3], dcm=X[:3, :3])


def over(state, steps=200, dt=0.01):
    """The state after a ride with hard turns and a force that changes."""
    rng = np.random.default_rng(4)
    force, rate = rng.normal([0.0, 0.0, 9.8], 5.0, (steps, 3)), rng.normal(0.0, 2.0, (steps, 3))
    passage = advance_navigation(state, force, rate, np.full(steps, dt), FLAT)
    return passage, passage.state(state, steps - 1)


def grown(xi, t):
    """xi after a time t, log-linear: no estimate is in it."""
    phi, rho, pi = xi[:3], xi[3:6], xi[6:]
    pulled = cross_matrix(GRAVITY) @ phi
    return np.concatenate([phi, rho + t * pulled, pi + t * rho + t**2 / 2.0 * pulled])


def test_an_error_of_any_size_grows_linearly_on_any_ride():
    xi = np.array([0.9, -0.6, 1.1, 3.0, -6.0, 2.0, 40.0, -25.0, 9.0])
    true, estimated = over(with_error(STATE, xi))[1], over(STATE)[1]

    eta = group(true) @ np.linalg.inv(group(estimated))
    np.testing.assert_allclose(eta, exp(grown(xi, 2.0)), atol=1e-9)


def test_phi_of_the_additive_error_is_that_of_the_invariant_error_in_other_numbers():
    passage, after = over(STATE, steps=1)
    Phi = transition(0.01, passage.mean_dcm[0], passage.force_enu_mps2[0])[:9, :9]
    invariant = numbers(after) @ Phi @ np.linalg.inv(numbers(STATE))

    expected = np.array([grown(xi, 0.01) for xi in np.eye(9)]).T
    np.testing.assert_allclose(invariant, expected, atol=2e-8)


@pytest.mark.parametrize(("about", "states"), [(STATE, 15), (WORN, 16)])
def test_a_correction_goes_in_by_the_exponential_of_the_group(about, states):
    dx = np.concatenate([LARGE, 1e-3 * np.arange(states - 9.0)])
    xi = np.concatenate([dx[6:9], dx[3:6] + np.cross(about.velocity_mps, dx[6:9]), dx[:3]])
    xi[6:] += np.cross(about.position_m, dx[6:9])
    after = corrected_on_group(about, dx)

    np.testing.assert_allclose(group(after), exp(xi) @ group(about), atol=1e-9)
    np.testing.assert_allclose(difference(after, about)[9:], dx[9:], atol=1e-15)


def test_the_left_jacobian_has_all_digits_at_small_and_at_large_angles():
    for size in (0.0, 1e-9, 1e-4, 0.3, 3.0):
        dx = np.zeros(15)
        dx[:3], dx[6:9] = [1.0, 2.0, 3.0], size * np.array([0.6, 0.0, -0.8])
        at_origin = STATE._replace(position_m=np.zeros(3))
        xi = np.concatenate([dx[6:9], np.zeros(3), dx[:3]])
        moved = (exp(xi) @ group(at_origin))[:3, 4]
        np.testing.assert_allclose(corrected_on_group(at_origin, dx).position_m, moved, rtol=1e-13)


@pytest.fixture(scope="module")
def drive():
    """Ten seconds, of which three at rest, with a first yaw that is 30 degrees off."""
    recording = FieldWhite(duration_s=10.0, reference_rate_hz=5.0).load(2)
    recording = replace(recording, heading=None)
    attitude = Tilt().estimate(recording)
    turn = Rotation.from_euler("z", 0.5).as_matrix()
    euler = attitude.euler_rad + np.array([0.0, 0.0, 0.5])
    return recording, replace(attitude, dcm=turn @ attitude.dcm, euler_rad=euler)


@pytest.mark.slow
def test_a_whole_run_agrees_with_the_filter_of_the_paper(drive):
    recording, attitude = drive
    model = InvariantEkf(initial_yaw_sigma_rad=0.5)
    solution = model.solve(recording, attitude, NoAdaptation())
    journey = model.inputs(recording, attitude)
    start, P0 = journey.start
    T = np.eye(15)
    T[:9, :9] = numbers(start)
    oracle = InvariantFilter(group(start), np.concatenate(start[3:5]), T @ P0 @ T.T, journey.settings.noise)
    events, measured = journey.events, journey.timeline.measurements
    for dt, sample, row in zip(events.dt_s, events.sample, events.update, strict=True):
        if dt > 0:
            oracle.predict(journey.imu.accel_mps2[sample], journey.imu.gyro_radps[sample], dt)
        if row >= 0:
            there = np.flatnonzero(np.isfinite(measured.z[row]))
            assert len(there) == 6
            oracle.update(measured.z[row], measured.R[row])

    T[:9, :9] = numbers(solution.state)
    got = T @ solution.covariance @ T.T
    sigma = np.sqrt(np.diag(oracle.P))
    apart = log(group(solution.state) @ np.linalg.inv(oracle.X))
    assert np.abs(apart / sigma[:9]).max() < 0.02
    assert np.abs((np.concatenate(solution.state[3:5]) - oracle.b) / sigma[9:]).max() < 0.02
    assert np.abs((got - oracle.P) / np.outer(sigma, sigma)).max() < 0.02
