"""NEES of a filter with and without states for the slow errors of a simulated receiver."""

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.datasets.field import Field
from jerkbench.geometry import dcm_from_euler

VAGUE = 1e4
"""Initial variance of position and velocity: (100 m)^2 and (100 m/s)^2."""

TIMES_S = (15.0, 35.0, 55.0)
"""Times with a distance of four times the longest correlation time of an error."""


def squares(d, seeds, times_s, *, modelled=True):
    """NEES of position and velocity (expected value 6) at the given times and of all seeds, with the true attitude.

    The state of each axis is x = [p, v, b, c]: p and v as in the baseline, b and c the slow errors of position and
    velocity::

        z_p = p + b + w_p,  var b = s sigma^2,  var w_p = (1 - s) sigma^2;  z_v = v + c + w_v

    A fix is used at its stamp minus the latency, and the lever arm is subtracted. Without ``modelled``, all noise is
    treated as white, and the latency and the lever arm are ignored. The covariances of all seeds are the same.
    """
    drives = [d.load(seed) for seed in seeds]
    u = np.stack([ReferenceAttitude().estimate(drive).accel_enu_mps2 for drive in drives], axis=1)  # (n, seeds, 3)
    dt = 1.0 / d.imu_rate_hz
    shares = np.array((d.position_coloured_share, d.velocity_coloured_share) if modelled else (0.0, 0.0))[:, None]
    sigmas = np.array([d.position_sigma_m, d.velocity_sigma_mps])  # (2, 3)
    decay = np.exp(-dt / np.array([d.position_coloured_time_s, d.velocity_coloured_time_s]))
    slow, fresh = shares * sigmas**2, (1 - shares) * sigmas**2
    A = np.diag([1.0, 1.0, *decay])
    A[0, 1] = dt
    b = np.array([0.5 * dt**2, dt, 0.0, 0.0])
    Q = np.zeros((3, 4, 4)) + d.accel_sigma_mps2**2 * np.outer(b, b)
    Q[:, [2, 3], [2, 3]] = ((1 - decay**2)[:, None] * slow).T
    speeds = by_sample([(drive.velocity.t_s, drive.velocity.mps) for drive in drives], dt)
    measured = (0, by_sample([fixes(drive, d, modelled) for drive in drives], dt)), (1, speeds)
    x = np.zeros((len(drives), 3, 4))
    P = np.stack([np.diag([VAGUE, VAGUE, *slow[:, axis]]) for axis in range(3)])
    requested, found = set(np.rint(np.asarray(times_s) / dt).astype(int)), []
    for k in range(1, len(u) + 1):
        x, P = x @ A.T + u[k - 1][..., None] * b, A @ P @ A.T + Q
        for row, values in measured:
            if k in values:
                x, P = updated(x, P, row, values[k], fresh[row])
        if k in requested:
            at = [np.searchsorted(drive.reference.t_s, k * dt - 1e-6) for drive in drives]
            truth = [
                (drive.reference.enu_m[r], drive.reference.velocity_mps[r]) for drive, r in zip(drives, at, strict=True)
            ]
            e = np.stack(truth).transpose(0, 2, 1) - x[..., :2]
            found.append(np.einsum("sai,aij,saj->s", e, np.linalg.inv(P[:, :2, :2]), e))
    return np.concatenate(found)


def by_sample(streams, dt):
    """Values (seeds, 3) by the number of the sample; all seeds have the same stamps."""
    rows = np.rint(streams[0][0] / dt).astype(int)
    return dict(zip(rows, np.stack([values for _, values in streams], axis=1), strict=True))


def fixes(drive, dataset, modelled):
    t_s, positions = drive.position.t_s, drive.position.enu_m
    if modelled:
        t_s = t_s - dataset.position_latency_s
        rows = np.searchsorted(drive.reference.t_s, t_s - 1e-6)
        positions = positions - dcm_from_euler(drive.reference.euler_rad[rows]) @ np.asarray(dataset.lever_arm_error_m)
    return t_s, positions


def updated(x, P, row, z, R):
    H = np.zeros(4)
    H[[row, row + 2]] = 1.0
    PH = P @ H
    K = PH / (PH @ H + R)[:, None]
    x = x + K * (z - x @ H)[..., None]
    L = np.eye(4) - K[:, :, None] * H
    return x, L @ P @ L.transpose(0, 2, 1) + R[:, None, None] * K[:, :, None] * K[:, None, :]


def mean_and_band(seeds, **how):
    values = squares(Field(duration_s=60.0), range(seeds), TIMES_S, **how)
    low, high = chi2.ppf([0.025, 0.975], 6 * len(values)) / len(values)
    return values.mean(), low, high


@pytest.mark.slow
def test_with_states_for_slow_errors_nees_lies_in_its_band():
    mean, low, high = mean_and_band(40)
    assert low < mean < high


def test_without_states_for_slow_errors_nees_is_too_high():
    mean, _, high = mean_and_band(4, modelled=False)
    assert mean > 5 * high
