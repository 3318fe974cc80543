"""Positions and vectors of a table, in any frame -> ENU."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_enu, ecef_to_origin, geodetic_to_ecef, geodetic_to_enu
from jerkbench.recording import Origin

FRAMES = ("enu", "ned", "geodetic", "ecef")
"""Frames of a position: local ENU or NED [m], latitude, longitude [deg or rad] and height [m], or ECEF [m]."""

LOCAL_FRAMES = ("enu", "ned")
"""Those whose zero is not said: it may be anywhere on the Earth."""

ANGLE_UNITS = {"deg": 1.0, "rad": float(np.degrees(1.0))}
"""Degrees in each unit of latitude and longitude."""

_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def in_degrees(places: FloatArray, frame: str, unit: str) -> FloatArray:
    """Return (n, 3) places, their latitude and longitude in degrees; those of other frames have none."""
    return places * ([ANGLE_UNITS[unit]] * 2 + [1.0]) if frame == "geodetic" else places


def origin_of(values: FloatArray, frame: str) -> Origin | None:
    """Return the first place as origin of ENU; None of a local frame.

    Raises:
        RecordingError: no row is complete.
    """
    if frame in LOCAL_FRAMES:
        return None
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        raise RecordingError(
            "The positions have no complete row to be the origin; check their columns, or give origin."
        )
    first = values[int(np.argmax(known))]
    return ecef_to_origin(first) if frame == "ecef" else Origin(*(float(value) for value in first))


def in_enu(values: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Turn (n, 3) places in ``frame`` into ENU [m]; latitude and longitude in degrees.

    A latitude and longitude without a height are east and north of a place between the heights before and after.
    """
    if frame == "ned":
        return axes_in_enu(values, frame)
    if origin is None or frame == "enu":
        return values
    if frame == "ecef":
        return ecef_to_enu(values, origin)
    latitude, longitude, height_m = values.T
    enu_m = geodetic_to_enu(latitude, longitude, _between(height_m, origin.height_m), origin)
    enu_m[np.isnan(height_m), 2] = np.nan
    return enu_m


def axes_to_judge(values: FloatArray, frame: str) -> FloatArray:
    """Return (n, k) axes [m] in which places are as far from each other as they are, without an origin.

    Of latitude, longitude and height: the place on the ellipsoid in ECEF, and the height, which may be missing alone.
    """
    if frame != "geodetic":
        return values
    return np.column_stack([geodetic_to_ecef(values[:, 0], values[:, 1], np.zeros(len(values))), values[:, 2]])


def _between(height_m: FloatArray, otherwise: float) -> FloatArray:
    """The heights (n,), those that are NaN on a line between their neighbours; ``otherwise`` where there is none."""
    missing = np.isnan(height_m)
    if not missing.any():
        return height_m
    rows, known = np.arange(len(height_m)), ~missing
    between = np.interp(rows, rows[known], height_m[known]) if known.any() else otherwise
    return np.where(missing, between, height_m)


def axes_in_enu(values: FloatArray, frame: str) -> FloatArray:
    """Turn (n, 3) vectors along the axes of a local frame into ENU; an axis that is NaN stays alone."""
    return values[:, [1, 0, 2]] * [1.0, 1.0, -1.0] if frame == "ned" else values


def enu_from(frame: str) -> FloatArray:
    """Return (3, 3) the turn from the axes of a local frame to ENU."""
    return _ENU_FROM_NED if frame == "ned" else np.eye(3)
