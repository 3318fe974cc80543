"""Errors of a real receiver, laid over the fixes of any recording."""

from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray, nearest_rows
from jerkbench.disturbances.common import (
    DrawnFault,
    fixes_of,
    own_stream,
    rows_of,
)
from jerkbench.io.files import fingerprint
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Reference
from jerkbench.simulation.traces import SHIPPED, Trace, read_trace, trace_path
from jerkbench.timeline import nanoseconds

FLOOR_M2 = 1e-6
"""(1 mm)^2: no variance is smaller."""
TOLERANCE_S = 1e-6


class Replayed(NamedTuple):
    """What happens to some of the fixes.

    Attributes:
        fixes: (k,) which of them (rows).
        error_m: (k, 3) ENU.
        reported_m2: (k, 3, 3).
        true_m2: (k, 3, 3).
    """

    fixes: IntArray
    error_m: FloatArray
    reported_m2: FloatArray
    true_m2: FloatArray


@register("disturbance", "replayed_gnss")
@dataclass(frozen=True)
class ReplayedGnss(DrawnFault):
    """Fixes that are off as a real receiver's were, and that report what it reported.

    A trace holds errors e_j (fix less a better reference) and reported covariances R_j of a real drive: jumps, false
    fixes, gaps, correlation and all. With a start and a rotation about the vertical W that the seed chooses, scale s,
    and j the row of the trace at the time of the fix::

        z' = z + s W e_j
        R' = R + s^2 W R_j W'
        R_true' = R_true + s^2 W M_j W',   M_j = mean of e e' over ``moment_s`` around row j

    Where an independent reference has a place at the very stamp of a fix (a simulation's truth has), that place stands
    for z, and R and R_true of the fix are left out: its own noise would be noise twice, and honest. M_j is what can be
    known of an error that nothing drew: its local second moment. The oracle is told that, not the error.

    A fix where the trace has a gap is dropped, and so is one of two that would share a row: a trace of 1 Hz gives fixes
    of 1 Hz. After its end a trace begins anew. Velocities and headings stay as they are.

    Attributes:
        trace: comma2k19 (open sky, 60 s), pixel4 (a phone) or tokyo_1105 (RTK among towers), or a file that `jerkbench
            data trace` wrote.
        scale: s, of errors and reported sigmas alike.
        start_s: where in the trace the recording's t = 0 is; null: the seed chooses.
        rotate: whether the seed chooses a rotation about the vertical.
        moment_s: length of the window of M_j.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    trace: str = "tokyo_1105"
    scale: Annotated[float, Limit(lambda s: 0 < s < np.inf, "it must be positive.")] = 1.0
    start_s: Annotated[float | None, Limit(np.isfinite, "give a time in the trace, or null.")] = None
    rotate: bool = True
    moment_s: Annotated[float, Limit(lambda s: 0 < s < np.inf, "a window must be longer than 0 s.")] = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check that the trace exists, and the numbers."""
        trace_path(self.trace)
        super().__post_init__()

    def fingerprint(self) -> str:
        """Return the SHA-256 of the trace's file; empty for those of this package, whose code answers for them."""
        path = trace_path(self.trace)
        return "" if path.parent == SHIPPED else fingerprint((path,))

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the trace as ``seed`` lays it.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so no receiver's errors can be laid over them.")
        trace = read_trace(trace_path(self.trace))
        laid = _laid(self._replayed(trace, position.t_s, seed), position, *_places(recording.reference, position))
        told = f"those of {trace.about.recording} against {trace.about.reference}."
        note = f"The errors of its fixes are replayed: {told}"
        return replace(recording, position=laid, notes=(*recording.notes, note))

    def _replayed(self, trace: Trace, t_s: FloatArray, seed: int) -> Replayed:
        random = own_stream(seed, "replayed_gnss", self.stream)
        chosen_s, angle = trace.t_s[random.integers(len(trace.t_s))], random.uniform(-np.pi, np.pi)
        start_s = chosen_s if self.start_s is None else self.start_s
        fixes, rows = _pairs(trace, t_s, float(start_s))
        cosine, sine = (np.cos(angle), np.sin(angle)) if self.rotate else (1.0, 0.0)
        W = self.scale * np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        moment = trace.local_moment_m2(self.moment_s)[rows] + FLOOR_M2 * np.eye(3)
        return Replayed(fixes, trace.error_m[rows] @ W.T, W @ trace.covariance_m2[rows] @ W.T, W @ moment @ W.T)


def _laid(replayed: Replayed, position: Position, true: FloatArray, known: BoolArray) -> Position:
    """Return the fixes that are left, with their new places and covariances."""
    keep = np.isin(np.arange(len(position.t_s)), replayed.fixes)
    own, exact = rows_of(position, keep), known[keep]
    noisy = ~exact[:, None, None]
    return replace(
        own,
        enu_m=np.where(exact[:, None], true[keep], own.enu_m) + replayed.error_m,
        covariance_m2=noisy * own.reported + replayed.reported_m2,
        true_covariance_m2=noisy * own.true + replayed.true_m2,
    )


def _places(reference: Reference, position: Position) -> tuple[FloatArray, BoolArray]:
    """Return the places (m, 3) of an independent reference at the very stamps of the fixes, and where there are any.

    A fix that lacks an axis keeps its own.
    """
    m = len(position.t_s)
    if not reference.independent or reference.enu_m is None or not len(reference.t_s):
        return np.full((m, 3), np.nan), np.zeros(m, dtype=np.bool_)
    rows = nearest_rows(reference.t_s, position.t_s)
    same = nanoseconds(reference.t_s[rows]) == nanoseconds(position.t_s)
    whole = np.isfinite(reference.enu_m[rows]).all(axis=1) & np.isfinite(position.enu_m).all(axis=1)
    return reference.enu_m[rows], same & whole


def _pairs(trace: Trace, t_s: FloatArray, start_s: float) -> tuple[IntArray, IntArray]:
    """Return which fixes (k,) meet which rows (k,) of the trace: at most one each, half an interval apart or less."""
    period, half = trace.period_s, 0.5 * trace.interval_s
    around = np.mod(t_s + start_s - trace.t_s[0] + half, period) - half  # the last half interval belongs to row 0
    rows = nearest_rows(trace.t_s - trace.t_s[0], around)
    distance_s = np.abs(trace.t_s[rows] - trace.t_s[0] - around)
    visit = np.floor((t_s + start_s - trace.t_s[0] + half) / period).astype(np.int64) * len(trace.t_s) + rows
    order = np.lexsort((np.arange(len(t_s)), np.round(distance_s, 6), visit))
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = visit[order][1:] != visit[order][:-1]
    fixes = np.sort(order[first])
    fixes = fixes[distance_s[fixes] <= half + TOLERANCE_S]
    return fixes, rows[fixes]
