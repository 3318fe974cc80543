"""Whether the parameters of a table are possible: every choice, and how many columns each of them names."""

from jerkbench.datasets._table_attitude import ATTITUDE_BODIES
from jerkbench.datasets._table_velocity import VELOCITY_FRAMES
from jerkbench.datasets._timed_columns import EPOCHS
from jerkbench.errors import PluginError
from jerkbench.readers.columns import TIME_UNITS
from jerkbench.readers.frames import ANGLE_UNITS, FRAMES
from jerkbench.readers.mounting import ACCEL_UNITS, GYRO_UNITS

CHOICES = {
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
    "time_unit": tuple(TIME_UNITS),
    "angle_unit": tuple(ANGLE_UNITS),
    "epoch": EPOCHS,
    "attitude_unit": tuple(ANGLE_UNITS),
    "attitude_frame": ("", "enu", "ned"),
    "position_frame": FRAMES,
    "reference_frame": FRAMES,
    "velocity_frame": VELOCITY_FRAMES,
    "reference_body": ATTITUDE_BODIES,
}
"""What each parameter may be."""

COUNTS = {
    "imu_accel": (3,),
    "imu_gyro": (3,),
    "position_columns": (3,),
    "position_sigma": (0, 1, 3),
    "velocity_columns": (3,),
    "reference_position": (0, 3),
    "reference_velocity": (0, 3),
    "reference_attitude": (0, 3, 4),
}
"""How many columns each parameter may name."""


def require_columns(table: object, velocity_frame: str) -> None:
    """Raise a PluginError that names the first of the parameters with another number of columns than it may have."""
    counts = COUNTS | ({"velocity_columns": (1,)} if velocity_frame == "speed" else {})
    for name, allowed in counts.items():
        given = getattr(table, name)
        if len(given) not in allowed:
            said = " or ".join(map(str, allowed))
            raise PluginError(f"dataset table: {name} names {len(given)} columns, {given}; it must name {said}.")
