"""A reference's attitude in degrees, or of a body with other axes."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.gyro import DEG_PER_RAD, WITHIN
from jerkbench.inspection.diagnosis.relation import SURE, slope, strength
from jerkbench.inspection.diagnosis.windows import window_means
from jerkbench.inspection.peaks import correlation_of
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Imu, Recording

LARGEST_RAD = 4 * np.pi
"""Angles that are unwrapped may pass pi; roll and pitch never this."""

LARGEST_DEGREE = 4.0
"""An attitude whose yaw stays below may be in radians."""

HALF_TURN_DEG = 90.0
"""No vehicle turns so far in half a second; an angle that jumps back by 360 degrees does."""

LENGTH_S = 0.5
LONGEST_GAP_S = 0.5
LEAST_ROWS = 20
LEAST_CORRELATION = 0.5


def attitude_mistakes(recording: Recording) -> list[Diagnosis]:
    """Return whether roll and pitch are in degrees, or turn against the gyro."""
    imu, reference = recording.imu, recording.reference
    if reference.euler_rad is None:
        return []
    steepest = float(np.nan_to_num(np.abs(reference.euler_rad[:, :2])).max(initial=0.0))
    if steepest > LARGEST_RAD:
        measured = f"roll or pitch reaches {steepest:.4g} where a half turn is 3.14"
        return [Diagnosis("attitude in degrees", measured, "The attitude is in degrees", "Set attitude_unit=deg")]
    t_s, euler = _known(reference.t_s, reference.euler_rad)
    if imu is None or len(t_s) < LEAST_ROWS:
        return []
    return _yaw_in_degrees(imu, t_s, euler[:, 2]) or _reversed_angles(imu, t_s, euler)


def _known(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = np.isfinite(values).all(axis=1)
    return t_s[rows], values[rows]


def _yaw_in_degrees(imu: Imu, t_s: FloatArray, yaw: FloatArray) -> list[Diagnosis]:
    """Compare the changes of yaw with the gyro's z axis, but for those that are a whole turn in degrees."""
    edges_s = np.arange(max(t_s[0], imu.t_s[0]), min(t_s[-1], imu.t_s[-1]), LENGTH_S)
    if len(edges_s) <= LEAST_ROWS or np.abs(yaw).max() < LARGEST_DEGREE:
        return []
    change = np.diff(np.interp(edges_s, t_s, yaw))
    turn_rad = window_means(imu.t_s, imu.gyro_radps, edges_s)[:, 2] * LENGTH_S
    plain = np.abs(change) < HALF_TURN_DEG
    if plain.sum() < LEAST_ROWS or not turn_rad[plain].any():
        return []
    change, turn_rad = change[plain], turn_rad[plain]
    correlation, factor = correlation_of(change, turn_rad), slope(change, turn_rad)
    sure = abs(strength(correlation, len(change))) >= SURE and abs(correlation) >= LEAST_CORRELATION
    if not sure or not 1 / WITHIN < abs(factor) / DEG_PER_RAD < WITHIN:
        return []
    measured = f"yaw turns {abs(factor):.3g} times as fast as the gyro says (correlation {correlation:.2f})"
    return [Diagnosis("attitude in degrees", measured, "The attitude is in degrees", "Set attitude_unit=deg")]


def _reversed_angles(imu: Imu, t_s: FloatArray, euler_rad: FloatArray) -> list[Diagnosis]:
    """Compare pitch and yaw, and roll, with the gyro turned by the attitude itself.

    With phi, theta, psi for Rz(psi) Ry(theta) Rx(phi)::

        p = phi' - psi' sin(theta),  q = theta' cos(phi) + psi' sin(phi) cos(theta),
        r = psi' cos(theta) cos(phi) - theta' sin(phi)

    FRD for FLU, or NED for ENU, turns pitch and yaw, q and r, the other way, and leaves roll. An IMU that is left in
    FRD does the same: nothing is said while gravity is not on +z.
    """
    if felt_axis(imu.accel_mps2) != "+z":
        return []
    edges_s = np.arange(max(t_s[0], imu.t_s[0]), min(t_s[-1], imu.t_s[-1]), LENGTH_S)
    if len(edges_s) <= LEAST_ROWS or np.median(np.diff(t_s)) > LONGEST_GAP_S:
        return []
    rates = _rates(t_s, euler_rad, edges_s)
    gyro = window_means(imu.t_s, imu.gyro_radps, edges_s)
    correlations = [correlation_of(rates[:, axis], gyro[:, axis]) for axis in range(3)]
    against = [
        name
        for name, correlation in zip(("roll", "pitch", "yaw"), correlations, strict=True)
        if correlation < -LEAST_CORRELATION and strength(correlation, len(rates)) < -SURE
    ]
    if "pitch" not in against and "yaw" not in against:
        return []
    shown = ", ".join(f"{value:.2f}" for value in correlations)
    measured = f"{' and '.join(against)} turn against the gyro (correlations about x, y, z: {shown})"
    remedy = "Set reference_body=frd and attitude_frame=ned, as the file's maker defines them, or correct imu_axes"
    return [Diagnosis("attitude of FRD", measured, "The attitude is not that of FLU in ENU", remedy)]


def attitude_turning(recording: Recording, length_s: float, late_s: float) -> tuple[FloatArray, FloatArray] | None:
    """Return rates (n, 3) of the reference's attitude in the body and those of the gyro, ``late_s`` later, or None.

    Over windows of ``length_s``; None without such an attitude, or with fewer than 20 windows.
    """
    imu, reference = recording.imu, recording.reference
    if imu is None or reference.euler_rad is None:
        return None
    t_s, euler_rad = _known(reference.t_s, reference.euler_rad)
    if len(t_s) < LEAST_ROWS or np.median(np.diff(t_s)) > LONGEST_GAP_S:
        return None
    edges_s = np.arange(t_s[0], t_s[-1], length_s)
    edges_s = edges_s[(edges_s + late_s > imu.t_s[0]) & (edges_s + late_s < imu.t_s[-1])]
    if len(edges_s) <= LEAST_ROWS:
        return None
    return _rates(t_s, euler_rad, edges_s), window_means(imu.t_s, imu.gyro_radps, edges_s + late_s)


def _rates(t_s: FloatArray, euler_rad: FloatArray, edges_s: FloatArray) -> FloatArray:
    unwrapped = np.unwrap(euler_rad, axis=0)
    angles = np.column_stack([np.interp(edges_s, t_s, column) for column in unwrapped.T])
    roll, pitch, _ = (0.5 * (angles[1:] + angles[:-1])).T
    rates = (np.diff(angles, axis=0) / np.diff(edges_s)[:, None]).T
    return np.column_stack(
        [
            rates[0] - rates[2] * np.sin(pitch),
            rates[1] * np.cos(roll) + rates[2] * np.sin(roll) * np.cos(pitch),
            rates[2] * np.cos(pitch) * np.cos(roll) - rates[1] * np.sin(roll),
        ]
    )
