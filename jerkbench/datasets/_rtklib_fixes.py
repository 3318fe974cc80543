"""The fixes of a receiver's solution: which of them are used, and what they say about the motion."""

from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.frames import axes_to_judge
from jerkbench.readers.latency import velocity_when_true
from jerkbench.readers.rtklib_pos import PosSolution
from jerkbench.recording import Position, Velocity
from jerkbench.sanitiser.fixes import steady_rows


def accepted_fixes(fixes: PosSolution, qualities: tuple[float, ...], path: Path) -> PosSolution:
    """Return the solution with only the fixes whose Q is one of ``qualities``.

    Raises:
        RecordingError: there is none; says which Q the file ``path`` has.
    """
    rows = np.isin(fixes.quality, qualities)
    if not rows.any():
        qualities_text = ", ".join(str(q) for q in np.unique(fixes.quality))
        raise RecordingError(
            f"{path} has no fix with Q in {qualities}; there is Q {qualities_text}: add it to accepted_quality."
        )
    return fixes.select(rows)


def steady_fixes(fixes: PosSolution) -> tuple[PosSolution, tuple[str, ...]]:
    """Return the solution without fixes that leap, and a note that counts them, or none.

    Raises:
        RecordingError: all of them leap.
    """
    t_s = np.asarray((fixes.gpst_ns - fixes.gpst_ns[0]) * 1e-9, dtype=np.float64)
    places = np.column_stack([fixes.latitude_deg, fixes.longitude_deg, fixes.height_m])
    steady, notes = steady_rows(t_s, axes_to_judge(places, "geodetic"))
    return fixes.select(steady), notes


def ground_speed(fixes: PosSolution, position: Position) -> FloatArray:
    """Return the speed over ground (m,): the receiver's, or, where it gives none, from fix to fix."""
    if fixes.speed_mps is not None:
        return fixes.speed_mps
    if len(position.t_s) < 2:
        return np.zeros(len(position.t_s))
    return np.asarray(np.hypot(*np.gradient(position.enu_m[:, :2], position.t_s, axis=0).T))


def velocity_of(fixes: PosSolution, t_s: FloatArray, latency_s: tuple[float, ...]) -> Velocity | None:
    """Return the velocities of the fixes at ``t_s`` (m,) when they were true; None where the file has none."""
    if fixes.velocity_enu_mps is None or fixes.velocity_covariance_m2ps2 is None:
        return None
    return velocity_when_true(t_s, fixes.velocity_enu_mps, fixes.velocity_covariance_m2ps2, latency_s)
