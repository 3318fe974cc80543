"""Checks of the parameters of a drive from RTKLIB's solution."""

from collections.abc import Collection, Mapping

from jerkbench.errors import PluginError
from jerkbench.readers.columns import TIME_UNITS
from jerkbench.readers.mounting import ACCEL_UNITS, GYRO_UNITS

EPOCHS = ("gps", "unix")
CHOICES: Mapping[str, Collection[str]] = {
    "accel_unit": ACCEL_UNITS,
    "gyro_unit": GYRO_UNITS,
    "imu_time_unit": TIME_UNITS,
    "imu_epoch": EPOCHS,
}
"""What each parameter may be."""


def require_three_columns(**columns: tuple[str, ...]) -> None:
    """Raise a PluginError that names the first of the parameters that does not have a column for each axis."""
    for name, axes in columns.items():
        if len(axes) != 3:
            raise PluginError(f"{name} is {axes}; give three columns: x, y, z.")


def require_latencies(latency_s: tuple[float, ...]) -> None:
    """Raise a PluginError unless there is a latency for each axis of the velocity."""
    if len(latency_s) != 3:
        raise PluginError(f"velocity_latency_s is {latency_s}; give three: east, north, up.")


def require_signs(signs: tuple[float, ...]) -> None:
    """Raise a PluginError unless each axis of the IMU has its sign."""
    if len(signs) != 3 or any(abs(sign) != 1 for sign in signs):
        raise PluginError(f"imu_axis_signs is {signs}; give 1 or -1 for each of x, y, z.")
