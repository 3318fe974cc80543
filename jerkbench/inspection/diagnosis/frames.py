"""East and north exchanged, or turned, in one of two streams that ought to agree."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.plane import EXCHANGED, IDENTITY, PLANE, axes_text, mended
from jerkbench.inspection.diagnosis.windows import window_means
from jerkbench.recording import Position, Recording

LENGTHS_S = (1.0, 8.0, 32.0)
"""Slow and coarse fixes say where they went over half a minute, not over a second."""

LEAST_ROWS = 20

LEAST_FIT = 0.9
LEAST_GAIN = 0.2
"""Mended axes fit at least so well, and by so much better than the axes as they are (cosines of both series)."""


class Pair(NamedTuple):
    """Ways from edge to edge that two streams say, each (n, 2) east and north [m/s]."""

    stream: str
    against: str
    given_mps: FloatArray
    right_mps: FloatArray


def exchanged_axes(recording: Recording) -> list[Diagnosis]:
    """Return which of ENU velocity and reference does not have the fixes' east and north.

    Both as mean velocities over 1, 8 and 32 s, the cosine of the two series is taken for each exchange of axes and
    signs; each stream once.
    """
    position = recording.position
    if position is None:
        return []
    told: dict[str, Diagnosis] = {}
    for length_s in LENGTHS_S:
        for pair in _pairs(recording, position, length_s):
            diagnosis = _judged(pair)
            if diagnosis is not None:
                told.setdefault(pair.stream, diagnosis)
    return list(told.values())


def _pairs(recording: Recording, position: Position, length_s: float) -> list[Pair]:
    pairs = []
    velocity, reference = recording.velocity, recording.reference
    if velocity is not None and velocity.frame == "enu":
        samples = _known(velocity.t_s, velocity.mps)
        pairs.append(_pair("velocity", samples, position, length_s, differentiate=False))
    if reference.enu_m is not None:
        samples = _known(reference.t_s, reference.enu_m)
        pairs.append(_pair("reference", samples, position, length_s, differentiate=True))
    return [pair for pair in pairs if pair is not None]


def _known(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = np.isfinite(values[:, :2]).all(axis=1)
    return t_s[rows], values[rows, :2]


def _pair(
    stream: str, samples: tuple[FloatArray, FloatArray], position: Position, length_s: float, *, differentiate: bool
) -> Pair | None:
    fix_s, places = _known(position.t_s, position.enu_m)
    t_s, values = samples
    if min(len(t_s), len(fix_s)) <= LEAST_ROWS:
        return None
    length_s = max(length_s, 2 * float(np.median(np.diff(fix_s))), 2 * float(np.median(np.diff(t_s))))
    edges_s = np.arange(max(t_s[0], fix_s[0]), min(t_s[-1], fix_s[-1]), length_s)
    if len(edges_s) <= LEAST_ROWS:
        return None
    velocity = _slope(t_s, values, edges_s) if differentiate else window_means(t_s, values, edges_s)
    return Pair(stream, "the fixes", velocity, _slope(fix_s, places, edges_s))


def _slope(t_s: FloatArray, places: FloatArray, edges_s: FloatArray) -> FloatArray:
    at_edges = np.column_stack([np.interp(edges_s, t_s, column) for column in places.T])
    return np.asarray(np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None], dtype=np.float64)


def _judged(pair: Pair) -> Diagnosis | None:
    size = float(np.sqrt(np.sum(pair.given_mps**2) * np.sum(pair.right_mps**2)))
    if size == 0:
        return None
    scores = {way: float(np.sum(mended(pair.given_mps, way) * pair.right_mps)) / size for way in PLANE}
    best = max(scores, key=lambda way: scores[way])
    if best == IDENTITY or scores[best] < LEAST_FIT or scores[best] - scores[IDENTITY] < LEAST_GAIN:
        return None
    east, north = axes_text(best, ("east", "north"))
    ned = ": NED for ENU, or latitude and longitude exchanged, in one of the two" if best == EXCHANGED else ""
    return Diagnosis(
        f"{pair.stream} against fixes: {best}",
        f"({east}, {north}) of the {pair.stream} fit {pair.against} (cosine {scores[best]:.3f}; as they are"
        f" {scores[IDENTITY]:.3f})",
        f"The {pair.stream} and {pair.against} do not have the same east and north{ned}",
        f"Set {pair.stream}_frame=ned or position_frame=ned, whichever is, or put the columns of one in order",
    )
