"""The trace of a recording's fixes, from a better reference."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording, Reference
from jerkbench.traces.trace import LEAST_ROWS, About, Trace

NEAR_S = 1.5
"""The reference is taken linearly between its stamps, where these are no further apart."""


def trace_of(recording: Recording, *, centred: bool = True, licence: str = "", origin: str = "") -> Trace:
    """Return the errors of the fixes against the reference, with the covariances as reported.

    Args:
        recording: with position fixes, and a reference that has positions of its own.
        centred: take the median off: a constant offset is a matter of datum and lever arm, which no fix shows.
        licence: of the data.
        origin: where the data are.

    Raises:
        RecordingError: it has no fixes, no reference but the fixes themselves, or too few that both have.
    """
    position, reference = recording.position, recording.reference
    if position is None or reference.enu_m is None:
        raise RecordingError(f"{recording.name} lacks position fixes or a reference of positions: no errors to trace.")
    true, known = _at(reference, position.t_s)
    kept = known & np.isfinite(position.enu_m).all(axis=1)
    if kept.sum() < LEAST_ROWS:
        raise RecordingError(
            f"{recording.name} has {kept.sum()} fixes where its reference is known; {LEAST_ROWS} are needed."
        )
    error = (position.enu_m - true)[kept]
    if not error.any():
        raise RecordingError(
            f"The reference of {recording.name} is its own fixes, which have no errors against themselves."
        )
    offset = np.median(error, axis=0) if centred else np.zeros(3)
    about = About(recording.name, reference.source, licence, origin, tuple(offset.tolist()))
    t_s = position.t_s[kept]
    return Trace(t_s - t_s[0], error - offset, position.covariance_m2[kept], about)


def _at(reference: Reference, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the reference (m, 3) at ``t_s``, and where it is known."""
    values = reference.enu_m
    usable = reference.scored & np.isfinite(values).all(axis=1) if values is not None else np.zeros(0, dtype=np.bool_)
    if values is None or usable.sum() < 2:
        return np.full((len(t_s), 3), np.nan), np.zeros(len(t_s), dtype=np.bool_)
    own_s, own_m = reference.t_s[usable], values[usable]
    after = np.clip(np.searchsorted(own_s, t_s), 1, len(own_s) - 1)
    near = own_s[after] - own_s[after - 1] <= NEAR_S
    exact = np.isin(np.round(t_s, 6), np.round(own_s, 6))
    inside = (t_s >= own_s[0]) & (t_s <= own_s[-1])
    true = np.column_stack([np.interp(t_s, own_s, own_m[:, axis]) for axis in range(3)])
    return true, (near & inside) | exact
