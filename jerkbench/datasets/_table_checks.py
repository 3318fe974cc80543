"""Checks of the parameters of a table: every choice, how many columns each of them names, the origin."""

from jerkbench.datasets._table_attitude import ATTITUDE_BODIES
from jerkbench.datasets._table_covariance import COVARIANCE_FRAMES, COVARIANCES, SIGMAS
from jerkbench.datasets._table_velocity import VELOCITY_FRAMES
from jerkbench.datasets._timed_columns import EPOCHS
from jerkbench.errors import PluginError
from jerkbench.readers.columns import TIME_UNITS
from jerkbench.readers.frames import ANGLE_UNITS, FRAMES, LOCAL_FRAMES
from jerkbench.readers.mounting import ACCEL_UNITS, GYRO_UNITS
from jerkbench.sanitiser.fixes import HIGHEST_M

CHOICES = {
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
    "time_unit": tuple(TIME_UNITS),
    "position_time_unit": ("", *TIME_UNITS),
    "velocity_time_unit": ("", *TIME_UNITS),
    "reference_time_unit": ("", *TIME_UNITS),
    "angle_unit": tuple(ANGLE_UNITS),
    "epoch": EPOCHS,
    "attitude_unit": tuple(ANGLE_UNITS),
    "attitude_frame": ("", "enu", "ned"),
    "position_frame": FRAMES,
    "reference_frame": FRAMES,
    "position_covariance_frame": COVARIANCE_FRAMES,
    "velocity_frame": VELOCITY_FRAMES,
    "reference_body": ATTITUDE_BODIES,
}
"""What each parameter may be."""

COUNTS = {
    "imu_accel": (3,),
    "imu_gyro": (3,),
    "position_columns": (3,),
    "position_sigma": SIGMAS,
    "position_covariance": COVARIANCES,
    "velocity_columns": (3,),
    "velocity_sigma": SIGMAS,
    "velocity_covariance": COVARIANCES,
    "reference_position": (0, 3),
    "reference_velocity": (0, 3),
    "reference_attitude": (0, 3, 4),
}
"""How many columns each parameter may name."""


def require_columns(table: object, velocity_frame: str) -> None:
    """Raise a PluginError that names the first of the parameters with another number of columns than it may have."""
    speed = {"velocity_columns": (1,), "velocity_sigma": (0, 1), "velocity_covariance": (0, 1)}
    counts = COUNTS | (speed if velocity_frame == "speed" else {})
    for name, allowed in counts.items():
        columns = getattr(table, name)
        if len(columns) not in allowed:
            counts_text = " or ".join(map(str, allowed))
            raise PluginError(
                f"dataset table: {name} names {len(columns)} columns, {columns}; it must name {counts_text}."
            )
    for stream in ("position", "velocity"):
        if getattr(table, f"{stream}_sigma") and getattr(table, f"{stream}_covariance"):
            raise PluginError(
                f"dataset table: {stream}_sigma and {stream}_covariance are both given; leave one of them empty."
            )


def require_origin(origin: tuple[float, ...]) -> None:
    """Raise a PluginError unless there is no origin, or one on Earth."""
    if not origin:
        return
    if len(origin) != 3:
        raise PluginError(
            f"dataset table: origin is {origin}; give latitude [deg], longitude [deg] and height [m], or none."
        )
    if not all(abs(value) <= most for value, most in zip(origin, (90.0, 360.0, HIGHEST_M), strict=True)):
        raise PluginError(
            f"dataset table: origin is {origin}, which is not on Earth; give latitude [deg], longitude [deg] and height"
            " [m], in this order."
        )


def require_one_origin(fixes: str, fixes_frame: str, reference_frame: str, origin: tuple[float, ...]) -> None:
    """Raise a PluginError where fixes and reference are about two origins: one is local, the other is not.

    Args:
        fixes: what says the frame of the fixes.
        fixes_frame: it.
        reference_frame: of the places of the reference.
        origin: of the local one, or none.
    """
    if not origin and (fixes_frame in LOCAL_FRAMES) != (reference_frame in LOCAL_FRAMES):
        raise PluginError(
            f"dataset table: {fixes} is {fixes_frame} and reference_frame {reference_frame}: one is local, and where"
            " its zero is on the Earth is not known; give origin (latitude [deg], longitude [deg], height [m] of that"
            " zero), or fixes and reference of one kind."
        )
