"""Mistakes that a person makes in a log, made in a recording."""

from dataclasses import replace

import numpy as np

from jerkbench.recording import Heading, Imu

G_MPS2 = 9.80665


def of_imu(recording, gyro=lambda w: w, accel=lambda f: f, late_s=0.0):
    imu = recording.imu
    return replace(recording, imu=Imu(imu.t_s + late_s, accel(imu.accel_mps2), gyro(imu.gyro_radps)))


def in_axes(recording, axes):
    """The IMU's axes as rows of ``axes``."""
    return of_imu(recording, lambda w: w @ np.array(axes).T, lambda f: f @ np.array(axes).T)


def of_fixes(recording, way):
    """The fixes in other axes; of a heading that was made of them, too."""
    position, heading = recording.position, recording.heading
    covariance = way @ position.covariance_m2 @ way.T
    if heading is not None and recording.name.startswith("test1"):
        course = np.column_stack([np.cos(heading.yaw_rad), np.sin(heading.yaw_rad)]) @ way[:2, :2].T
        heading = Heading(heading.t_s, np.arctan2(course[:, 1], course[:, 0]), heading.sigma_rad, heading.source)
    moved = replace(position, enu_m=position.enu_m @ way.T, covariance_m2=covariance, true_covariance_m2=None)
    return replace(recording, position=moved, heading=heading)


def ned(recording):
    return of_fixes(recording, np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))


def latitude_for_longitude(recording):
    """Metres: a degree of latitude read as one of longitude at a latitude that was the longitude, and back."""
    origin = recording.origin
    lat, lon = (0.0, 0.0) if origin is None else np.radians([origin.latitude_deg, origin.longitude_deg])
    way = np.array([[0.0, abs(np.cos(lon)), 0.0], [1 / np.cos(lat), 0.0, 0.0], [0.0, 0.0, 1.0]])
    return of_fixes(recording, way)


def velocity_ned(recording):
    way = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    velocity = recording.velocity
    covariance = way @ velocity.covariance_m2ps2 @ way.T
    mps = np.column_stack([velocity.mps[:, 1], velocity.mps[:, 0], -velocity.mps[:, 2]])  # NaN stays where it is
    return replace(
        recording, velocity=replace(velocity, mps=mps, covariance_m2ps2=covariance, true_covariance_m2ps2=None)
    )


def of_sigmas(recording, factor):
    position = recording.position
    return replace(recording, position=replace(position, covariance_m2=position.covariance_m2 * factor**2))


def of_attitude(recording, factor):
    reference = recording.reference
    return replace(recording, reference=replace(reference, euler_rad=reference.euler_rad * np.array(factor)))


MISTAKES = {
    "gyro in deg/s": lambda r: of_imu(r, gyro=np.degrees),
    "accelerometer in g": lambda r: of_imu(r, accel=lambda f: f / G_MPS2),
    "accelerometer 9.8 times too large": lambda r: of_imu(r, accel=lambda f: f * G_MPS2),
    "IMU turned by 90 degrees": lambda r: in_axes(r, [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "IMU turned by 180 degrees": lambda r: in_axes(r, [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]),
    "IMU mirrored": lambda r: in_axes(r, [[1, 0, 0], [0, -1, 0], [0, 0, 1]]),
    "fixes in NED": ned,
    "IMU's clock off by 1 s": lambda r: of_imu(r, late_s=1.0),
    "sd of the fixes 10 times too small": lambda r: of_sigmas(r, 0.1),
    "latitude and longitude exchanged": latitude_for_longitude,
}
"""The ten of the table; they need an IMU and fixes."""

OTHERS = {
    "velocity in NED": velocity_ned,
    "attitude in degrees": lambda r: of_attitude(r, [np.degrees(1.0)] * 3),
    "attitude of FRD": lambda r: of_attitude(r, [1.0, -1.0, -1.0]),
}
"""Those that need more."""

EXCHANGED = ("track mirrored", "reference against fixes: axes exchanged", "speed against fixes: axes exchanged")

NAMES = {
    "gyro in deg/s": ("gyro in deg/s",),
    "accelerometer in g": ("accelerometer in g",),
    "accelerometer 9.8 times too large": ("accelerometer 9.8 times too large",),
    "IMU turned by 90 degrees": ("IMU to be rotated by -90 degrees about z",),
    "IMU turned by 180 degrees": ("IMU to be rotated by 180 degrees about z",),
    "IMU mirrored": ("IMU mirrored",),
    "fixes in NED": EXCHANGED,
    "IMU's clock off by 1 s": ("clock of imu",),
    "sd of the fixes 10 times too small": ("sd of position too small",),
    "latitude and longitude exchanged": EXCHANGED,
    "velocity in NED": ("velocity against fixes: axes exchanged",),
    "attitude in degrees": ("attitude in degrees",),
    "attitude of FRD": ("attitude of FRD",),
}
"""The names that a diagnosis of each may have."""


def is_found(mistake, diagnoses):
    """Whether the mistake that was made is told, and nothing else.

    A tenth of sigmas that are too large may be no contradiction, and is then not found; a wrong name never counts.
    """
    names = [diagnosis.name for diagnosis in diagnoses]
    assert not names or (len(names) == 1 and names[0] in NAMES[mistake]), f"{mistake}: {names}"
    return bool(names)
