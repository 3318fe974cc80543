"""The smoother over the inertial navigation, against one least-squares solution of a whole run."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import cholesky, lstsq, solve_triangular
from stepping import mechanise
from test_error_state import derivative, difference

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.disturbances.outages import GnssOutage
from jerkbench.filters.eskf15 import Eskf15, Eskf15Smoother
from jerkbench.inertial.run import ForwardRun, smooth_backward
from jerkbench.inertial.state import FLAT, process_noise
from synthetic import level_attitude, recording_at_rest, with_fix_noise


def noisy_rest(seed=1):
    rest = with_fix_noise(recording_at_rest(duration_s=3.0, imu_rate_hz=20, static_start_s=2.0), seed)
    noise = np.random.default_rng(seed + 1).normal(0.0, 0.002, (len(rest.imu.t_s), 3))
    return replace(rest, imu=replace(rest.imu, accel_mps2=rest.imu.accel_mps2 + noise))


SMALL = {
    "initial_yaw_sigma_rad": 1e-4,
    "velocity_random_walk_mps_per_sqrt_h": 0.03,
    "accel_turn_on_mg": 0.01,
    "gyro_turn_on_deg_per_h": 1.0,
}
"""Errors so small that the navigation is linear: g phi^2/2 is below 1e-3 of the sigma of a bias."""


def batch_solution(journey):
    """Errors (n, 15) of the open-loop trajectory at all steps, given everything at once, and their covariance."""
    events, measured, (state, P0) = journey.events, journey.timeline.measurements, journey.start
    n, open_loop = len(events.dt_s), [state]
    rows, right = [], []

    def add(blocks, residual, covariance):
        whole = np.zeros((len(residual), 15 * n))
        for k, block in blocks:
            whole[:, 15 * k : 15 * k + 15] = block
        root = cholesky(covariance, lower=True)
        rows.append(solve_triangular(root, whole, lower=True))
        right.append(solve_triangular(root, residual, lower=True))

    add([(0, np.eye(15))], np.zeros(15), P0)
    for k in range(n):
        dt, sample = events.dt_s[k], events.sample[k]
        if dt > 0:
            sensed = journey.imu.accel_mps2[sample], journey.imu.gyro_radps[sample], dt, FLAT
            after = mechanise(open_loop[-1], *sensed)[0]
            Phi = derivative(
                lambda s, given=sensed, to=after: difference(mechanise(s, *given)[0], to), 15, about=open_loop[-1]
            )
            add([(k, np.eye(15)), (k - 1, -Phi)], np.zeros(15), process_noise(journey.settings.noise, dt))
            open_loop.append(after)
        row = events.update[k]
        if row >= 0:
            here = np.concatenate([open_loop[-1].position_m, open_loop[-1].velocity_mps])
            add([(k, np.eye(6, 15))], measured.z[row] - here, measured.R[row])
    A, b = np.vstack(rows), np.concatenate(right)
    scale = 1.0 / np.linalg.norm(A, axis=0)
    errors = scale * lstsq(A * scale, b)[0]
    upper = np.linalg.qr(A * scale, mode="r")
    inverse = scale[:, None] * np.linalg.inv(upper)
    return open_loop, errors.reshape(n, 15), inverse @ inverse.T


@pytest.mark.slow
def test_it_is_the_least_squares_solution_of_the_whole_run():
    recording = noisy_rest()
    model = Eskf15Smoother(**SMALL)
    journey = model.inputs(recording, level_attitude(recording))
    assert len(journey.events.dt_s) < 70
    assert journey.events.dt_s[0] == 0.0
    open_loop, errors, joint = batch_solution(journey)
    estimate = model.estimate(recording, level_attitude(recording), NoAdaptation())
    run = ForwardRun(journey, NoAdaptation())
    run.solve()
    nodes = smooth_backward(run.nodes)

    at = np.flatnonzero(journey.events.reference >= 0)
    assert [node.reference for node in run.nodes] == journey.events.reference[at].tolist()
    for k, step in enumerate(at):
        covariance = joint[15 * step : 15 * step + 15, 15 * step : 15 * step + 15]
        sigma = np.sqrt(np.diag(covariance))
        got = difference(nodes[k].state, open_loop[step])
        assert np.abs((got - errors[step]) / sigma).max() < 2e-3
        assert np.abs((nodes[k].covariance - covariance) / np.outer(sigma, sigma)).max() < 2e-3
        np.testing.assert_array_equal(estimate.position_m[k], nodes[k].state.position_m)
        np.testing.assert_array_equal(estimate.covariance[k], nodes[k].covariance[:6, :6])


def drive(seed):
    recording = FieldWhite(duration_s=30.0, reference_rate_hz=5.0).load(seed)
    return GnssOutage(windows_s=((18.0, 28.0),)).apply(recording, seed)


def test_its_last_estimate_is_the_filters_and_the_point_given_out_may_lie_elsewhere():
    recording = drive(1)
    attitude = Tilt().estimate(recording)
    arm = {"reference_point_m": (0.5, -0.2, 1.0), "antenna_m": (0.1, 0.3, 0.9)}
    filtered, smoothed = (model(**arm).estimate(recording, attitude, Mtf()) for model in (Eskf15, Eskf15Smoother))

    np.testing.assert_array_equal(smoothed.index, filtered.index)
    np.testing.assert_allclose(smoothed.position_m[-1], filtered.position_m[-1], atol=1e-12)
    np.testing.assert_allclose(smoothed.covariance[-1], filtered.covariance[-1], atol=1e-15)
    assert np.linalg.eigvalsh(filtered.covariance[20:-20] - smoothed.covariance[20:-20]).min() > -1e-9


def test_a_lost_forward_pass_ends_where_it_was_lost():
    recording = drive(3)
    imu = recording.imu
    accel = imu.accel_mps2.copy()
    accel[1000:] = 1e300
    spoiled = replace(recording, imu=replace(imu, accel_mps2=accel))
    with np.errstate(all="ignore"):
        estimate = Eskf15Smoother().estimate(spoiled, Tilt().estimate(recording), NoAdaptation())

    assert estimate.failure.startswith("the covariance is no longer positive definite at 10.")
    assert np.isfinite(estimate.position_m).all()
