"""A Kalman filter over a timeline in dense textbook form, for a correction that is handed in."""

from typing import NamedTuple

import numpy as np


class Prior(NamedTuple):
    """What a correction sees: the state before it, and what P came from: P = F before F' + Q."""

    x: np.ndarray
    P: np.ndarray
    before: np.ndarray
    F: np.ndarray
    Q: np.ndarray


def run_plain(timeline, model, correct):
    """(x, P) at each stamp of the reference; ``correct(prior, z, H, R, rows) -> x, P`` sees the rows that are there."""
    n = 6 + 3 * len(model.initial_variances())
    x, P = np.zeros(n), np.zeros((n, n))
    x[:6], P[:6, :6] = timeline.x0, timeline.P0
    P[6:, 6:] = np.diag(np.repeat(model.initial_variances(), 3))
    before, steps, states = P, [], []
    for k, dt in enumerate(timeline.dt_s):
        if dt > 0:
            A, b, Q = (np.kron(part, np.eye(3)) for part in three(model, dt, timeline.dt0_s))
            x, P = A @ x + b @ timeline.accel_enu_mps2[timeline.sample[k]], A @ P @ A.T + Q
            steps.append((A, Q))
        row = timeline.update[k]
        if row >= 0:
            z = timeline.measurements.z[row]
            rows = np.flatnonzero(np.isfinite(z))
            if len(rows):
                R = timeline.measurements.R[row][np.ix_(rows, rows)]
                x, P = correct(Prior(x, P, before, *gathered(steps, n)), z[rows], np.eye(n)[rows], R, rows)
                before, steps = P, []
        if timeline.reference[k] >= 0:
            states.append((x, P))
    return states


def assert_follows(estimate, states):
    """The estimate is what the plain filter says, to 1e-8 (its inverses carry no more) of x and of sqrt(P_ii P_jj)."""
    assert estimate.failure == ""
    x, P = (np.array(part) for part in zip(*states, strict=True))
    sigma = np.sqrt(np.einsum("kii->ki", P[:, :6, :6]))
    np.testing.assert_allclose(estimate.position_m, x[:, :3], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(estimate.velocity_mps, x[:, 3:6], rtol=1e-8, atol=1e-9)
    scaled = (estimate.covariance - P[:, :6, :6]) / (sigma[:, :, None] * sigma[:, None, :])
    np.testing.assert_allclose(scaled, 0.0, atol=1e-8)


def three(model, dt, dt0):
    A, b, Q = model.axis_model(dt, dt0)
    return A, b[:, None], Q


def gathered(steps, n):
    """F and Q of several steps: every Q is carried on by the steps after it."""
    F, Q = np.eye(n), np.zeros((n, n))
    for A, own in reversed(steps):
        Q = Q + F @ own @ F.T
        F = F @ A
    return F, Q


def update(x, P, z, H, R):
    """The textbook update, in information form."""
    information = np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H
    posterior = np.linalg.inv(information)
    return x + posterior @ H.T @ np.linalg.inv(R) @ (z - H @ x), posterior
