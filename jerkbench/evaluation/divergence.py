"""Divergence: how far a run may stray, and which runs are lost."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import position_error_m
from jerkbench.recording import Recording
from jerkbench.sums import Streamed

LIMIT_M = 1000.0
"""A larger position error is a divergence, unless `divergence_limit_m` says otherwise; the frozen suite has its own."""


def run_status(estimate: Estimate, recording: Recording, limit_m: float) -> tuple[str, str]:
    """Return ("ok", "") or ("diverged", why).

    A run diverged if it stopped early, reached none of the reference's stamps, has a position or velocity (of one that
    estimates the attitude only: an angle) that is not finite, or a position error over ``limit_m`` on the axes that the
    reference knows (also where it is not scored).
    """
    reason = why_stopped(estimate) or _too_far(estimate, recording, limit_m)
    return ("diverged", reason) if reason else ("ok", "")


def strays(result: Streamed, limit_m: float) -> bool:
    """Whether a position error of a run without a trajectory was over ``limit_m``.

    Such a run is run alone and judged by `run_status`: a stricter rule there is asked for here, too.
    """
    return result.farthest_m2 > limit_m**2


def why_stopped(estimate: Estimate) -> str:
    """Return why the run stopped early, or an empty string."""
    if estimate.failure or len(estimate.index):
        return estimate.failure
    return "The run reached none of the reference's stamps."


def _too_far(estimate: Estimate, recording: Recording, limit_m: float) -> str:
    t_s = recording.reference.t_s[estimate.index]
    finite = np.isfinite(_state(estimate)).all(axis=1)
    if not finite.all():
        return f"The state is not finite at {t_s[np.argmin(finite)]:.2f} s."
    with np.errstate(over="ignore"):
        distance_m = np.sqrt(np.nansum(position_error_m(estimate, recording) ** 2, axis=1))
    far = distance_m > limit_m
    if not far.any():
        return ""
    first = int(np.argmax(far))
    return f"The position error is {distance_m[first]:.0f} m at {t_s[first]:.2f} s; the limit is {limit_m:g} m."


def _state(estimate: Estimate) -> FloatArray:
    """What was estimated (k, n): position and velocity, or one of them and the angles alone."""
    if estimate.attitude_only:
        return estimate.euler_rad
    return estimate.position_m if estimate.position_only else np.hstack([estimate.position_m, estimate.velocity_mps])
