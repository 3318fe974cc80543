"""Geodetic coordinates and rotations in the conventions of `jerkbench.recording`, computed by pymap3d and SciPy."""

from dataclasses import astuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Origin


def geodetic_to_enu(
    latitude_deg: FloatArray, longitude_deg: FloatArray, height_m: FloatArray, origin: Origin
) -> FloatArray:
    """Convert WGS-84 coordinates (n,) [deg, deg, m] to ENU (n, 3) [m] at ``origin``."""
    from pymap3d import geodetic2enu

    return np.column_stack(geodetic2enu(latitude_deg, longitude_deg, height_m, *astuple(origin)))


def geodetic_to_ecef(latitude_deg: FloatArray, longitude_deg: FloatArray, height_m: FloatArray) -> FloatArray:
    """Convert WGS-84 coordinates (n,) [deg, deg, m] to ECEF (n, 3) [m]."""
    from pymap3d import geodetic2ecef

    return np.column_stack(geodetic2ecef(latitude_deg, longitude_deg, height_m))


def enu_to_geodetic(enu_m: FloatArray, origin: Origin) -> FloatArray:
    """Convert ENU (n, 3) [m] at ``origin`` to latitude, longitude and height (n, 3) [deg, deg, m]."""
    from pymap3d import enu2geodetic

    return np.column_stack(enu2geodetic(enu_m[:, 0], enu_m[:, 1], enu_m[:, 2], *astuple(origin)))


def ecef_to_enu(ecef_m: FloatArray, origin: Origin) -> FloatArray:
    """Convert ECEF (n, 3) [m] to ENU (n, 3) [m] at ``origin``."""
    from pymap3d import ecef2enu

    return np.column_stack(ecef2enu(ecef_m[:, 0], ecef_m[:, 1], ecef_m[:, 2], *astuple(origin)))


def enu_to_ecef(enu_m: FloatArray, origin: Origin) -> FloatArray:
    """Convert ENU (n, 3) [m] at ``origin`` to ECEF (n, 3) [m]."""
    from pymap3d import enu2ecef

    return np.column_stack(enu2ecef(enu_m[:, 0], enu_m[:, 1], enu_m[:, 2], *astuple(origin)))


def ecef_to_geodetic(ecef_m: FloatArray) -> FloatArray:
    """Convert ECEF (n, 3) [m] to latitude, longitude and height (n, 3) [deg, deg, m]."""
    from pymap3d import ecef2geodetic

    return np.column_stack(ecef2geodetic(ecef_m[:, 0], ecef_m[:, 1], ecef_m[:, 2]))


def ecef_to_origin(ecef_m: FloatArray) -> Origin:
    """Return the origin at the point ``ecef_m`` (3,) [m]."""
    from pymap3d import ecef2geodetic

    return Origin(*(float(value) for value in ecef2geodetic(*ecef_m)))


def enu_axes(origin: Origin) -> FloatArray:
    """Return E (3, 3) with v_enu = E v_ecef. The rows of E are the unit vectors east, north and up at ``origin``."""
    lat, lon = np.radians([origin.latitude_deg, origin.longitude_deg])
    return np.array(
        [
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )


def dcm_from_quaternion(xyzw: FloatArray) -> FloatArray:
    """Return the rotation matrices (n, 3, 3) of unit quaternions (n, 4) with the scalar last."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix())


def quaternion_from_dcm(dcm: FloatArray) -> FloatArray:
    """Return the unit quaternions (n, 4), with the scalar last, of rotation matrices (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(dcm).as_quat())


def dcm_from_euler(euler_rad: FloatArray) -> FloatArray:
    """Return Omega = Rz(yaw) Ry(pitch) Rx(roll) (..., 3, 3) of roll, pitch and yaw (..., 3) [rad].

    The elements are computed explicitly, because a matrix is needed for every sample and the general function of SciPy
    takes six times as long.
    """
    angles = np.ascontiguousarray(np.moveaxis(np.asarray(euler_rad, dtype=np.float64), -1, 0))
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    dcm = np.empty((*angles.shape[1:], 3, 3))
    cysp, sysp = cy * sp, sy * sp
    dcm[..., 0, 0], dcm[..., 0, 1], dcm[..., 0, 2] = cy * cp, cysp * sr - sy * cr, cysp * cr + sy * sr
    dcm[..., 1, 0], dcm[..., 1, 1], dcm[..., 1, 2] = sy * cp, sysp * sr + cy * cr, sysp * cr - cy * sr
    dcm[..., 2, 0], dcm[..., 2, 1], dcm[..., 2, 2] = -sp, cp * sr, cp * cr
    return dcm


def euler_from_dcm(dcm: FloatArray) -> FloatArray:
    """Return roll, pitch and yaw (n, 3) [rad] of rotation matrices (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(dcm).as_euler("ZYX"))[:, ::-1]


def euler_from_rotations(dcm: FloatArray) -> FloatArray:
    """Return roll, pitch and yaw (n, 3) [rad] of exact rotation matrices (n, 3, 3), which need no orthogonalisation."""
    pitch = np.arctan2(-dcm[:, 2, 0], np.hypot(dcm[:, 2, 1], dcm[:, 2, 2]))
    roll, yaw = np.arctan2(dcm[:, 2, 1], dcm[:, 2, 2]), np.arctan2(dcm[:, 1, 0], dcm[:, 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)


def euler_from_quaternion(wxyz: FloatArray) -> FloatArray:
    """Return roll, pitch and yaw (n, 3) [rad] of quaternions (n, 4), scalar first, that rotate from body to ENU."""
    from scipy.spatial.transform import Rotation

    return euler_from_dcm(np.asarray(Rotation.from_quat(np.asarray(wxyz), scalar_first=True).as_matrix()))


def vertical_in_body(euler_rad: FloatArray) -> FloatArray:
    """Return the vertical Omega' e3 (..., 3) in the body frame for roll, pitch and yaw (..., 3) [rad]."""
    roll, pitch = euler_rad[..., 0], euler_rad[..., 1]
    return np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=-1)


def roll_pitch(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return roll atan2(x2, x3) and pitch atan2(-x1, hypot(x2, x3)) [rad] for the vertical x = Omega' e3 (..., 3)."""
    return np.arctan2(x[..., 1], x[..., 2]), np.arctan2(-x[..., 0], np.hypot(x[..., 1], x[..., 2]))


def best_rotation(b: FloatArray, a: FloatArray) -> FloatArray:
    """Return the rotation C (3, 3) that minimises sum |b_i - C a_i|^2 over the rows of b and a (n, 3) (Kabsch)."""
    U, _, V = np.linalg.svd(b.T @ a)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V)


def wrap_angle(angle_rad: FloatArray) -> FloatArray:
    """Wrap an angle [rad] to (-pi, pi].

    >>> float(wrap_angle(np.array(-np.pi)))
    3.141592653589793
    """
    return np.asarray(np.pi - np.mod(np.pi - angle_rad, 2 * np.pi))
