"""What a data set needs to use RTKLIB's solution.

In this order: which fixes are used, and what they say about the motion (`table` uses the first two as well); the checks
of the parameters of `rtklib`; the sentences under its tables.
"""

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.io.clocks import velocity_when_true
from jerkbench.io.columns import TIME_UNITS
from jerkbench.io.frames import ACCEL_UNITS, GYRO_UNITS, axes_to_judge
from jerkbench.io.rtklib import PosSolution
from jerkbench.io.sanitiser import steady_rows
from jerkbench.recording import Position, Velocity


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


def velocity_of_fixes(fixes: PosSolution, t_s: FloatArray, latency_s: tuple[float, ...]) -> Velocity | None:
    """Return the velocities of the fixes at ``t_s`` (m,) when they were true; None where the file has none."""
    if fixes.velocity_enu_mps is None or fixes.velocity_covariance_m2ps2 is None:
        return None
    return velocity_when_true(t_s, fixes.velocity_enu_mps, fixes.velocity_covariance_m2ps2, latency_s)


EPOCHS = ("gps", "unix")
CHOICES: Mapping[str, Collection[str]] = {
    "accel_unit": ACCEL_UNITS,
    "gyro_unit": GYRO_UNITS,
    "imu_time_unit": TIME_UNITS,
    "imu_epoch": EPOCHS,
}
"""What each parameter may be."""


ENTRIES = {"imu_accel": (3,), "imu_gyro": (3,), "velocity_latency_s": (3,), "imu_axis_signs": (3,)}
"""How many entries each parameter has: x, y, z; of the latencies east, north, up."""


SAME = "The receiver's fixes are measurement and reference at once unless they are withheld from the filter."

HEIGHTS = {
    True: (),
    False: ("Heights are above mean sea level, not above the ellipsoid, as the solution's header says.",),
    None: ("The solution's header does not say what heights are above, the ellipsoid or mean sea level.",),
}
"""Notes where heights are above the ellipsoid, above mean sea level, or nobody says above what."""

FITTED = {
    "mounting": ("mounting_yaw_deg", "mounting_pitch_deg"),
    "time shift": ("imu_shift_s",),
    "latencies": ("velocity_latency_s",),
}
"""What was fitted on the public drive itself, and the parameters whose defaults it is."""


def solution_notes(solution: PosSolution) -> tuple[str, ...]:
    """Return the notes that hold for every drive whose fixes are ``solution``."""
    return (*solution.notes, *HEIGHTS[solution.ellipsoidal], SAME)


def fitted_notes(drive: object) -> tuple[str, ...]:
    """Return a note that says which parameters of ``drive`` are the defaults, fitted on the public drive; or none."""
    own = type(drive)
    fitted = [subject for subject, names in FITTED.items() if any(getattr(drive, n) == getattr(own, n) for n in names)]
    if not fitted:
        return ()
    listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
    singular = fitted in (["mounting"], ["time shift"])
    verbs = "is the default, which was" if singular else "are the defaults, which were"
    return (f"{listed.capitalize()} {verbs} fitted on the public drive drive_0708: for no other drive.",)
