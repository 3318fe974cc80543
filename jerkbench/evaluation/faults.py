"""The windows in which a recording's measurements are at fault."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.recording import Recording

LARGER = 4.0
"""So many times its reported variance is the true one of a measurement at fault: two sigma stand for one."""


def fault_windows_s(recording: Recording) -> FloatArray:
    """Return (k, 2) begin and end of each fault, by their begins: outages, and measurements worse than they say.

    A measurement is at fault where the true variance of an axis, which simulated and disturbed recordings carry, is
    `LARGER` times the reported one; such measurements of a stream that follow each other are one fault, which ends with
    the first that is none. Windows that overlap are one.
    """
    position, velocity = recording.position, recording.velocity
    windows = [recording.outages_s]
    if position is not None and position.true_covariance_m2 is not None:
        windows.append(_windows(position.t_s, position.covariance_m2, position.true_covariance_m2))
    if velocity is not None and velocity.true_covariance_m2ps2 is not None:
        windows.append(_windows(velocity.t_s, velocity.covariance_m2ps2, velocity.true_covariance_m2ps2))
    return _joined(np.concatenate(windows))


def _windows(t_s: FloatArray, reported: FloatArray, true: FloatArray) -> FloatArray:
    """Return (k, 2) first stamp at fault and first that is not any more, or the last of all."""
    says, is_ = (np.diagonal(covariance, axis1=1, axis2=2) for covariance in (reported, true))
    at_fault: BoolArray = np.any(is_ > LARGER * says, axis=1)
    edges = np.diff(np.concatenate([[False], at_fault, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return np.column_stack([t_s[begins], t_s[np.minimum(ends, len(t_s) - 1)]])


def _joined(windows_s: FloatArray) -> FloatArray:
    """Return windows that do not overlap, from windows (k, 2)."""
    joined: list[list[float]] = []
    for begin, end in windows_s[np.argsort(windows_s[:, 0], kind="stable")].tolist():
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return np.array(joined).reshape(-1, 2)
