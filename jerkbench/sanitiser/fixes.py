"""Faulty fixes: impossible ones, leaps, and jumps where the kind of fix changes."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.ros.messages import Messages
from jerkbench.sanitiser.ledger import DROPPED, KEPT, Ledger

LOWEST_M, HIGHEST_M = -1000.0, 20_000.0
LEAP_M, LEAP_MPS = 50.0, 100.0
"""A fix that is further from the median of its neighbours than this, plus this a second, is damage."""

MANOEUVRE_MPS2 = 10.0
ANOTHER_LEVEL = 4.0
"""A ratio of traces from which another covariance means another kind of fix."""


def without_no_fix(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    """Drop what has the status -1, and coordinates that are not on Earth (or exactly 0, 0: never filled in)."""
    none = messages["status"][:, 0] < 0
    ledger.add(stream, "status -1 (no fix)", none, messages.bag_ns, DROPPED)
    messages = messages.rows(~none)
    lat, lon, height = (messages[name][:, 0] for name in ("latitude", "longitude", "altitude"))
    on_earth = (np.abs(lat) <= 90) & (np.abs(lon) <= 180) & (height > LOWEST_M) & (height < HIGHEST_M)
    bad = ~on_earth | ((lat == 0) & (lon == 0))
    ledger.add(stream, "coordinates that are NaN, zero or not on Earth", bad, messages.bag_ns, DROPPED)
    return messages.rows(~bad)


def without_leaps(stream: str, messages: Messages, ledger: Ledger, field: str) -> Messages:
    """Drop positions [m] (n, 3) that no vehicle can have reached from its neighbours."""
    leaps = leaping_rows(np.asarray(messages.stamp_ns * 1e-9), messages[field])
    ledger.add(stream, "a position that leaps out of its neighbours", leaps, messages.bag_ns, DROPPED)
    return messages.rows(~leaps)


def steady_rows(t_s: FloatArray, position_m: FloatArray) -> tuple[BoolArray, tuple[str, ...]]:
    """Return (n,) which fixes do not leap, and a note that counts the others, or none.

    Raises:
        RecordingError: all of them leap.
    """
    leaps = leaping_rows(t_s, position_m)
    count, n = int(leaps.sum()), len(leaps)
    if count and count == n:
        raise RecordingError(
            f"All {n} fixes leap out of their neighbours by more than {LEAP_M:g} m; check the columns of the places,"
            " their frame and unit, and the times."
        )
    predicate = "leaps out of its" if count == 1 else "leap out of their"
    notes = (f"{count} of {n} fixes {predicate} neighbours by more than {LEAP_M:g} m: dropped.",) if count else ()
    return ~leaps, notes


def leaping_rows(t_s: FloatArray, position_m: FloatArray) -> BoolArray:
    """Return (n,) which are too far from the median of the five positions around them.

    An axis that is NaN was not measured: a position is judged by its other axes, each of them beside the nearest five
    that were. It leaps where, with the time that the five take::

        sum over the axes of (distance / (50 m + 100 m/s time))^2 > 1
    """
    over = np.zeros(len(position_m))
    for axis in position_m.T:
        known = np.flatnonzero(np.isfinite(axis))
        over[known] += _over_limit(t_s[known], axis[known]) ** 2
    leaps: BoolArray = over > 1
    return leaps


def _over_limit(t_s: FloatArray, axis_m: FloatArray) -> FloatArray:
    """Return (n,) each value's distance from the median of the five around it, over its limit; of fewer than 5, 0."""
    n = len(axis_m)
    if n < 5:
        return np.zeros(n)
    around = np.clip(np.arange(n), 2, n - 3)[:, None] + np.arange(-2, 3)  # at the ends the nearest five
    span_s = t_s[around[:, -1]] - t_s[around[:, 0]]
    return np.asarray(np.abs(axis_m - np.median(axis_m[around], axis=1)) / (LEAP_M + LEAP_MPS * span_s))


def report_jumps(stream: str, messages: Messages, ledger: Ledger, field: str, status: FloatArray | None = None) -> None:
    """Count jumps where status or covariance level changes: a receiver leaves or finds its fixed solution.

    The position [m] of ``field`` is compared with the one extrapolated from the two before; a jump is more than 3 sigma
    of both and what 10 m/s2 would explain.
    """
    p, t_s = messages[field], messages.stamp_ns * 1e-9
    if len(p) < 3:
        return
    dt = np.diff(t_s)
    trace = np.trace(messages["position_covariance"].reshape(-1, 3, 3), axis1=1, axis2=2)
    ratio = trace[2:] / trace[1:-1]
    changed = (ratio > ANOTHER_LEVEL) | (ratio < 1 / ANOTHER_LEVEL)
    if status is not None:
        changed |= np.diff(status)[1:] != 0
    expected = p[1:-1] + (p[1:-1] - p[:-2]) * (dt[1:] / dt[:-1])[:, None]
    explained = 3 * np.sqrt(trace[2:] + trace[1:-1]) + 0.5 * MANOEUVRE_MPS2 * (dt[1:] ** 2 + dt[1:] * dt[:-1])
    jumped = changed & (np.linalg.norm(p[2:] - expected, axis=1) > explained)
    rows = np.concatenate([[False, False], jumped])
    ledger.add(stream, "a jump at a change of the kind of fix", rows, messages.bag_ns, KEPT)
