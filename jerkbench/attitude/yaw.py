"""The yaw filter: one state, the offset between yaw and the integrated yaw rate."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import wrap_angle
from jerkbench.recording import Heading


def yaw_rate(gyro_radps: FloatArray, roll_rad: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Rate of yaw (n,) [rad/s]: (w_y sin(roll) + w_z cos(roll))/cos(pitch). Singular at a pitch of 90 degrees."""
    across = gyro_radps[:, 1] * np.sin(roll_rad) + gyro_radps[:, 2] * np.cos(roll_rad)
    return np.asarray(across / np.cos(pitch_rad))


def estimate_yaw(
    t_s: FloatArray, dt_s: FloatArray, rate_radps: FloatArray, headings: Heading | None, walk_rad_per_sqrt_s: float
) -> FloatArray:
    """Return yaw (n,) at the IMU's stamps, in (-pi, pi].

    psi(t) is the integral of the yaw rate. Yaw adds to it exactly, so the filter on yaw is a filter on the offset
    yaw - psi, which changes at headings only; each stands at its own time, inside a sample where need be. Sample k
    uses headings up to t_k; before the first one, the first one less the integrated rate. Without headings yaw
    starts at zero.

    Args:
        t_s: (n,) stamps.
        dt_s: (n,) the interval that ends at each stamp.
        rate_radps: (n,) mean yaw rate over that interval.
        headings: at least one, or None.
        walk_rad_per_sqrt_s: random walk of yaw.
    """
    psi = np.cumsum(dt_s * rate_radps)
    if headings is None:
        return wrap_angle(psi)
    # Linear between the nodes is exact: the rate is constant within a sample.
    nodes_s = np.concatenate(([t_s[0] - dt_s[0]], t_s))
    psi_there = np.interp(headings.t_s, nodes_s, np.concatenate(([0.0], psi)))
    offsets = filter_offset(headings, psi_there, walk_rad_per_sqrt_s)
    latest = np.searchsorted(headings.t_s, t_s, side="right") - 1
    return wrap_angle(psi + offsets[np.maximum(latest, 0)])


def filter_offset(headings: Heading, psi_rad: FloatArray, walk_rad_per_sqrt_s: float) -> FloatArray:
    """Return the offset yaw - psi (m,) after each heading.

    P0 = variance of the first heading;  P += (time since the last) walk^2;  innovation = wrap(z - psi - offset);
    K = P/(P + sigma^2);  offset += K innovation;  P = (1 - K) P.
    """
    offsets = np.empty(len(headings.t_s))
    offsets[0] = offset = headings.yaw_rad[0] - psi_rad[0]
    P = headings.sigma_rad[0] ** 2
    for k in range(1, len(offsets)):
        P += (headings.t_s[k] - headings.t_s[k - 1]) * walk_rad_per_sqrt_s**2
        K = P / (P + headings.sigma_rad[k] ** 2)
        offset += K * wrap_angle(headings.yaw_rad[k] - psi_rad[k] - offset)
        P *= 1 - K
        offsets[k] = offset
    return offsets
