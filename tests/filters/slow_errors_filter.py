"""A plain filter that knows what a simulated receiver's errors are: its slow errors are states. An oracle for tests."""

import numpy as np

from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.geometry import dcm_from_euler

VAGUE = 1e4
"""(100 m)^2 and (100 m/s)^2: nothing is known at the start."""


def squares(dataset, seed, times_s, *, modelled=True):
    """NEES of position and velocity (expect 6) at the given times, with the true attitude.

    For each axis x = [p, v, b, c]: p and v as the baseline has them, b and c the slow errors of position and velocity::

        z_p = p + b + w_p,  var b = s sigma^2,  var w_p = (1 - s) sigma^2;  z_v likewise with c

    A fix is taken at its own time, stamp less latency, and less the lever arm. Without ``modelled`` all of the noise is
    taken for white, and the fix for what its stamp and place say.
    """
    drive, d = dataset.load(seed), dataset
    u = ReferenceAttitude().estimate(drive).accel_enu_mps2
    dt, n = 1.0 / d.imu_rate_hz, len(u)
    shares = (d.position_coloured_share, d.velocity_coloured_share) if modelled else (0.0, 0.0)
    sigmas = np.array([d.position_sigma_m, d.velocity_sigma_mps])  # (2, 3)
    keep = np.exp(-dt / np.array([d.position_coloured_time_s, d.velocity_coloured_time_s]))
    slow, fresh = np.array(shares)[:, None] * sigmas**2, (1 - np.array(shares))[:, None] * sigmas**2
    A = np.diag([1.0, 1.0, *keep])
    A[0, 1] = dt
    b = np.array([0.5 * dt**2, dt, 0.0, 0.0])
    Q = np.zeros((3, 4, 4)) + d.accel_sigma_mps2**2 * np.outer(b, b)
    Q[:, [2, 3], [2, 3]] = ((1 - keep**2)[:, None] * slow).T
    fixes = _fixes(drive, d, modelled)
    speeds = dict(zip(np.rint(drive.velocity.t_s / dt).astype(int), drive.velocity.mps, strict=True))
    x = np.zeros((3, 4))
    P = np.stack([np.diag([VAGUE, VAGUE, *slow[:, axis]]) for axis in range(3)])
    wanted, found = set(np.rint(np.asarray(times_s) / dt).astype(int)), []
    truth = drive.reference
    for k in range(1, n + 1):
        x = x @ A.T + u[k - 1][:, None] * b
        P = A @ P @ A.T + Q
        for row, values in ((0, fixes), (1, speeds)):
            if k in values:
                x, P = _updated(x, P, row, values[k], fresh[row])
        if k in wanted:
            at = np.searchsorted(truth.t_s, k * dt - 1e-6)
            e = np.column_stack([truth.enu_m[at], truth.velocity_mps[at]]) - x[:, :2]
            found.append(sum(e[i] @ np.linalg.solve(P[i, :2, :2], e[i]) for i in range(3)))
    return found


def _fixes(drive, dataset, modelled):
    """Places by sample."""
    t_s, places = drive.position.t_s, drive.position.enu_m
    if modelled:
        t_s = t_s - dataset.position_latency_s
        rows = np.searchsorted(drive.reference.t_s, t_s - 1e-6)
        arm = dcm_from_euler(drive.reference.euler_rad[rows]) @ np.asarray(dataset.lever_arm_error_m)
        places = places - arm
    return dict(zip(np.rint(t_s * dataset.imu_rate_hz).astype(int), places, strict=True))


def _updated(x, P, row, z, R):
    H = np.zeros(4)
    H[[row, row + 2]] = 1.0
    PH = P @ H
    K = PH / (PH @ H + R)[:, None]
    x = x + K * (z - x @ H)[:, None]
    L = np.eye(4) - K[:, :, None] * H
    return x, L @ P @ L.transpose(0, 2, 1) + R[:, None, None] * K[:, :, None] * K[:, None, :]
