"""Columns of a table -> parts of a recording, in its frames and units."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import ecef_to_enu, geodetic_to_enu
from jerkbench.recording import Origin

FRAMES = ("enu", "ned", "geodetic", "ecef")
"""Frames of a position: local ENU or NED [m], latitude, longitude [deg or rad] and height [m], or ECEF [m]."""

_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def axes_matrix(axes: tuple[str, ...]) -> FloatArray:
    """Return (3, 3) M with f_body = M f_sensor, of what the body's x, y, z are: ("z", "-y", "x") for instance.

    Raises:
        PluginError: these are not three axes of the sensor, or they make a left-handed body.
    """
    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.lstrip("+-")
        if len(axes) != 3 or name not in ("x", "y", "z") or len(axis) - len(name) > 1:
            raise PluginError(f"imu_axes is {axes}; give three of x, y, z, -x, -y, -z: what the body's x, y, z are.")
        turn[row, "xyz".index(name)] = -1.0 if axis.startswith("-") else 1.0
    if not np.isclose(np.linalg.det(turn), 1.0):
        raise PluginError(f"imu_axes is {axes}, which makes no right-handed body; check the signs.")
    return turn


def origin_of(values: FloatArray, frame: str) -> Origin | None:
    """Return the first place as origin of ENU; None of a local frame.

    Raises:
        RecordingError: no row is complete.
    """
    from jerkbench.geometry import ecef_to_origin

    if frame in ("enu", "ned"):
        return None
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        raise RecordingError("The positions have no complete row; check their columns.")
    first = values[int(np.argmax(known))]
    return ecef_to_origin(first) if frame == "ecef" else Origin(*(float(value) for value in first))


def in_enu(values: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Turn (n, 3) places in ``frame`` into ENU [m]; latitude and longitude in degrees."""
    if frame == "ned":
        return axes_in_enu(values, frame)
    if origin is None or frame == "enu":
        return values
    if frame == "ecef":
        return ecef_to_enu(values, origin)
    return geodetic_to_enu(values[:, 0], values[:, 1], values[:, 2], origin)


def axes_in_enu(values: FloatArray, frame: str) -> FloatArray:
    """Turn (n, 3) vectors along the axes of a local frame into ENU; an axis that is NaN stays alone."""
    return values[:, [1, 0, 2]] * [1.0, 1.0, -1.0] if frame == "ned" else values


def enu_from(frame: str) -> FloatArray:
    """Return (3, 3) the turn from the axes of a local frame to ENU."""
    return _ENU_FROM_NED if frame == "ned" else np.eye(3)
