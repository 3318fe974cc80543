"""The yaw filter: one state, the offset between yaw and the integrated yaw rate."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.track import Track, courses_of, filter_drift, offsets_at, rate_at_rest
from jerkbench.geometry import wrap_angle
from jerkbench.recording import Heading

UNKNOWN_RAD = np.pi / np.sqrt(3.0)
"""One sigma of a yaw of which nothing is known: any direction is as likely."""


class Yaw(NamedTuple):
    """Yaw at the IMU's stamps.

    Attributes:
        rad: (n,) in (-pi, pi].
        sigma_rad: (n,) one standard deviation, as the filter sees it.
    """

    rad: FloatArray
    sigma_rad: FloatArray


def yaw_rate(gyro_radps: FloatArray, roll_rad: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Rate of yaw (n,) [rad/s]: (w_y sin(roll) + w_z cos(roll))/cos(pitch). Singular at a pitch of 90 degrees."""
    across = gyro_radps[:, 1] * np.sin(roll_rad) + gyro_radps[:, 2] * np.cos(roll_rad)
    return np.asarray(across / np.cos(pitch_rad))


def estimate_yaw(
    t_s: FloatArray,
    dt_s: FloatArray,
    rate_radps: FloatArray,
    source: Heading | Track | None,
    walk_rad_per_sqrt_s: float,
    course_sigma_min_rad: float = 0.0,
) -> Yaw:
    """Return yaw at the IMU's stamps.

    psi(t) is the integral of the yaw rate. Yaw adds to it exactly, so the filter on yaw is a filter on the offset
    yaw - psi, which changes at headings only; each stands at its own time, inside a sample where need be. Sample k
    uses headings up to t_k; before the first one, the first one less the integrated rate. The courses of a track
    take the place of headings, see `jerkbench.attitude.track`. Without either yaw starts at zero, and nobody knows it.

    Args:
        t_s: (n,) stamps.
        dt_s: (n,) the interval that ends at each stamp.
        rate_radps: (n,) mean yaw rate over that interval.
        source: headings, at least one; the track of the fixes; or None.
        walk_rad_per_sqrt_s: random walk of yaw.
        course_sigma_min_rad: least standard deviation of a course of the track.
    """
    psi = np.cumsum(dt_s * rate_radps)
    if source is None:
        return Yaw(wrap_angle(psi), np.full(len(psi), UNKNOWN_RAD))
    # Linear between the nodes is exact: the rate is constant within a sample.
    nodes_s = np.concatenate(([t_s[0] - dt_s[0]], t_s))
    nodes_rad = np.concatenate(([0.0], psi))
    if isinstance(source, Track):
        courses = courses_of(source.chords, nodes_s, nodes_rad, course_sigma_min_rad)
        at_rest = rate_at_rest(t_s, rate_radps, source.rest_s, walk_rad_per_sqrt_s)
        drift = filter_drift(courses, at_rest, walk_rad_per_sqrt_s)
        offset, sigma = offsets_at(drift, t_s, walk_rad_per_sqrt_s)
        return Yaw(wrap_angle(psi + offset), sigma)
    offsets, variances = filter_offset(source, np.interp(source.t_s, nodes_s, nodes_rad), walk_rad_per_sqrt_s)
    latest = np.maximum(np.searchsorted(source.t_s, t_s, side="right") - 1, 0)
    since_s = np.abs(t_s - source.t_s[latest])
    return Yaw(wrap_angle(psi + offsets[latest]), np.sqrt(variances[latest] + since_s * walk_rad_per_sqrt_s**2))


def filter_offset(headings: Heading, psi_rad: FloatArray, walk_rad_per_sqrt_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the offset yaw - psi (m,) after each heading, and its variance (m,).

    P0 = variance of the first heading;  P += (time since the last) walk^2;  innovation = wrap(z - psi - offset);
    K = P/(P + sigma^2);  offset += K innovation;  P = (1 - K) P.
    """
    offsets, variances = np.empty((2, len(headings.t_s)))
    offsets[0] = offset = float(headings.yaw_rad[0] - psi_rad[0])
    variances[0] = P = float(headings.sigma_rad[0] ** 2)
    walked = np.diff(headings.t_s) * walk_rad_per_sqrt_s**2
    steps = walked.tolist(), (headings.yaw_rad - psi_rad)[1:].tolist(), (headings.sigma_rad[1:] ** 2).tolist()
    for k, (walk, measured, variance) in enumerate(zip(*steps, strict=True), start=1):
        P += walk
        K = P / (P + variance)
        offset += K * (math.pi - (math.pi - (measured - offset)) % (2.0 * math.pi))  # `wrap_angle` of a number
        P *= 1 - K
        offsets[k], variances[k] = offset, P
    return offsets, variances
