"""The disturbance ``replayed_gnss``, which adds recorded errors of a real receiver to the fixes."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray, nearest_rows
from jerkbench.disturbances.common import (
    DrawnFault,
    fault_stream,
    fixes_of,
    rows_of,
)
from jerkbench.io.files import fingerprint
from jerkbench.parameters import ABOVE_ZERO, Limit
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Reference
from jerkbench.simulation.traces import SHIPPED, Trace, read_trace, trace_path
from jerkbench.timeline import nanoseconds

FLOOR_M2 = 1e-6
"""Minimum variance, (1 mm)^2."""
TOLERANCE_S = 1e-6


@register("disturbance", "replayed_gnss")
@dataclass(frozen=True)
class ReplayedGnss(DrawnFault):
    """Adds recorded errors and reported covariances of a real receiver to the fixes.

    A trace contains the errors e_j (fix minus a more accurate reference) and the reported covariances R_j of a real
    drive. Jumps, false fixes, gaps and correlations of the real errors are preserved. The start time in the trace and
    the rotation W about the vertical depend on the seed. A fix z uses the row j of the trace at the time of the fix.
    The errors are multiplied by the scale s::

        z' = z + s W e_j
        R' = R + s^2 W R_j W'
        R_true' = R_true + s^2 W M_j W',   M_j = mean of e e' over ``moment_s`` around row j

    If an independent reference has a position at exactly the stamp of a fix (as in a simulation), this position
    replaces z, and R and R_true are replaced by 0. Without this replacement, the noise of the simulation would be added
    to the recorded errors. M_j is the local second moment of the recorded errors. The matrix M_j serves as the true
    covariance, because the true covariance of a recorded error is not known. The adaptation `oracle` uses the true
    covariance and not the recorded error.

    Fixes in a gap of the trace are removed. Two fixes cannot use the same row of the trace, so a trace with 1 Hz gives
    fixes with at most 1 Hz. After its end, the trace is repeated from its start. Velocities and headings do not change.

    Attributes:
        trace: name of a trace, comma2k19 (open sky, 60 s), pixel4 (a phone) or tokyo_1105 (RTK in a city with high
            buildings), or a file written by `jerkbench data trace`.
        scale: s, factor on the errors and on the reported standard deviations [-].
        start_s: time in the trace that corresponds to t = 0 of the recording; if null, a random time [s].
        rotate: if true, the errors are rotated about the vertical by a random angle.
        moment_s: length of the averaging window of M_j [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    trace: str = "tokyo_1105"
    scale: Annotated[float, ABOVE_ZERO] = 1.0
    start_s: Annotated[float | None, Limit(np.isfinite, "give a time in the trace, or null.")] = None
    rotate: bool = True
    moment_s: Annotated[float, ABOVE_ZERO] = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        trace_path(self.trace)
        super().__post_init__()

    def fingerprint(self) -> str:
        """Return a hash of the trace file, or an empty string for a trace that is part of this package."""
        path = trace_path(self.trace)
        return "" if path.parent == SHIPPED else fingerprint((path,))

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the errors of the trace; ``seed`` determines the start time and the rotation.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so replayed_gnss cannot be applied; remove replayed_gnss.")
        trace = read_trace(trace_path(self.trace))
        random = fault_stream(seed, "replayed_gnss", self.stream)
        random_s, angle = trace.t_s[random.integers(len(trace.t_s))], random.uniform(-np.pi, np.pi)
        start_s = random_s if self.start_s is None else self.start_s
        retained, rows = _pairs(trace, position.t_s, float(start_s))
        cosine, sine = (np.cos(angle), np.sin(angle)) if self.rotate else (1.0, 0.0)
        W = self.scale * np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        moment = trace.local_moment_m2(self.moment_s)[rows] + FLOOR_M2 * np.eye(3)
        true_m, known = _true_positions(recording.reference, position)
        fixes, exact = rows_of(position, retained), known[retained]
        start_m = np.where(exact[:, None], true_m[retained], fixes.enu_m)
        noisy = ~exact[:, None, None]
        reported_m2 = noisy * fixes.reported + W @ trace.covariance_m2[rows] @ W.T
        fixes = fixes.changed(start_m + trace.error_m[rows] @ W.T, reported_m2, noisy * fixes.true + W @ moment @ W.T)
        source = f"the errors of {trace.about.recording} against {trace.about.reference}."
        return replace(recording, position=fixes, notes=(*recording.notes, f"Its fixes have replayed errors: {source}"))


def _true_positions(reference: Reference, position: Position) -> tuple[FloatArray, BoolArray]:
    """Return positions (m, 3) of an independent reference at the stamps of the fixes, and a mask (m,) of valid rows.

    A row is valid if the reference has a position at exactly the stamp of the fix, and if the fix has all three axes.
    """
    m = len(position.t_s)
    if not reference.independent or reference.enu_m is None or not len(reference.t_s):
        return np.full((m, 3), np.nan), np.zeros(m, dtype=np.bool_)
    rows = nearest_rows(reference.t_s, position.t_s)
    same = nanoseconds(reference.t_s[rows]) == nanoseconds(position.t_s)
    complete = np.isfinite(reference.enu_m[rows]).all(axis=1) & np.isfinite(position.enu_m).all(axis=1)
    return reference.enu_m[rows], same & complete


def _pairs(trace: Trace, t_s: FloatArray, start_s: float) -> tuple[IntArray, IntArray]:
    """Return the row indices (k,) of the retained fixes, and of the trace rows that these fixes use.

    A fix uses the nearest row of the trace, if the times differ by at most half the interval of the trace. Each row is
    used for at most one fix in each repetition of the trace.
    """
    period, half = trace.period_s, 0.5 * trace.interval_s
    around = np.mod(t_s + start_s - trace.t_s[0] + half, period) - half  # the last half interval uses row 0
    rows = nearest_rows(trace.t_s - trace.t_s[0], around)
    distance_s = np.abs(trace.t_s[rows] - trace.t_s[0] - around)
    visit = np.floor((t_s + start_s - trace.t_s[0] + half) / period).astype(np.int64) * len(trace.t_s) + rows
    order = np.lexsort((np.arange(len(t_s)), np.round(distance_s, 6), visit))
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = visit[order][1:] != visit[order][:-1]
    fixes = np.sort(order[first])
    fixes = fixes[distance_s[fixes] <= half + TOLERANCE_S]
    return fixes, rows[fixes]
