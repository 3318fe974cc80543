"""A simulated drive along any path, which is a spline through waypoints or through a recorded trajectory."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.columns import TextFormat
from jerkbench.io.files import fingerprint
from jerkbench.io.readers import read_columns
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Recording
from jerkbench.simulation.motion import Drive, Way, WaypointPath, curve_way, table_curve
from jerkbench.simulation.sensors import Sensors
from jerkbench.simulation.truth import Truth, draw_vibration

STILL_MPS = 0.01
"""Maximum speed at which the vehicle counts as stationary at the start of a trajectory [m/s]."""


@register("dataset", "path")
@dataclass(frozen=True)
class DrivenPath(Sensors):
    """A simulated vehicle that drives a given path: waypoints, or a recorded trajectory.

    The path of waypoints is a cubic spline r(u) through the waypoints, where u is the sum of the straight distances
    between successive waypoints. The vehicle is first stationary, then accelerates to its speed, and decelerates to
    stop at the last waypoint. The speed changes are quintic smoothsteps.

    A trajectory is a CSV file with lines t, east, north, up [s, m] and an optional header. A cubic spline over time
    interpolates the positions of the file, or smooths them if ``smoothing_m`` is positive. The first time in the file
    becomes t = 0. A trajectory makes it possible to simulate a real drive with known noise.

    The vehicle points along its path: yaw = atan2(v_n, v_e), pitch = -atan(slope of the path), roll = 0. The vehicle
    never drives backwards. While a trajectory is slower than ``course_min_speed_mps``, yaw and pitch are interpolated
    linearly. Vibration is part of the true motion, as in `field`, and its amplitude grows from the first movement on.
    No terrain is added to the path. All simulated vehicles have the same equations and parameters of the sensors, which
    are described below.

    Attributes:
        waypoints_m: east, north (or east, north, up) of each waypoint [m], ignored if ``file`` is not empty.
        file: path of the CSV file, relative to the working directory, or empty for a path of waypoints.
        stand_s: duration for which the vehicle is stationary at the start of a path of waypoints [s].
        ramp_s: time in which a vehicle on waypoints reaches its speed, and in which the vibration reaches its rms [s].
        speed_mps: speed along the waypoints [m/s].
        smoothing_m: standard deviation of the positions in the file on each axis [m], or 0 if they are exact.
        course_min_speed_mps: horizontal speed above which yaw and pitch follow the direction of the trajectory [m/s].
        vibration_mps2: rms of the vertical vibration [m/s2]. The vibration east and north is 0.7 times as large.
        vibration_rad: rms of the vibration of roll, of pitch and of yaw [rad].
    """

    seeded: ClassVar[bool] = True

    waypoints_m: tuple[tuple[float, ...], ...] = ((0.0, 0.0), (60.0, 0.0), (70.0, 10.0), (60.0, 20.0), (0.0, 20.0))
    file: str = ""
    stand_s: float = 3.0
    ramp_s: float = 3.0
    speed_mps: float = 1.5
    smoothing_m: float = 0.0
    course_min_speed_mps: float = 0.2
    vibration_mps2: float = 0.3
    vibration_rad: float = 5e-4

    def __post_init__(self) -> None:
        subject = "dataset path"
        self.check_sensors(subject)
        require_positive(subject, self, ("ramp_s", "speed_mps", "course_min_speed_mps"))
        require_not_negative(subject, self, ("stand_s", "smoothing_m", "vibration_mps2", "vibration_rad"))
        if not self.file:
            _require_path(self.waypoints_m)

    def load(self, seed: int) -> Recording:
        """Return the recording of the simulated drive, with the noise of ``seed``.

        Raises:
            PluginError: the path of the waypoints is too short to accelerate and to decelerate within ``ramp_s``.
            RecordingError: the file is missing or damaged, or the trajectory is too short or too slow.
        """
        truth, rest_s = self.truth(seed)
        return self.record(Path(self.file).stem if self.file else "path", truth, seed, rest_s)

    def fingerprint(self) -> str:
        """Return a hash of the content of the file, or an empty string for a path of waypoints."""
        if not self.file:
            return ""
        if not self._path.is_file():
            raise RecordingError(f"There is no file {self._path}; correct 'file', or omit 'file' to use waypoints_m.")
        return fingerprint((self._path,))

    def truth(self, seed: int) -> tuple[Truth, float]:
        """Return the true motion from t = 0 on at the rate of the IMU, and the duration of the first rest [s]."""
        t_s, way, rest_s = self._table() if self.file else self._waypoints()
        sizes = (self.unless_silent("vibration", size) for size in (self.vibration_mps2, self.vibration_rad))
        vibration = draw_vibration(stream(seed, "dataset", "vibration"), *sizes)
        shaking = vibration.grown(t_s, rest_s, self.ramp_s)
        return Truth(t_s, *(motion + shake for motion, shake in zip(way, shaking, strict=True))), rest_s

    @property
    def _path(self) -> Path:
        return Path(self.file).expanduser()

    def _times(self, duration_s: float) -> FloatArray:
        self.check_length("dataset path", duration_s)
        return np.arange(int(duration_s * self.imu_rate_hz + 1e-6) + 1) / self.imu_rate_hz

    def _waypoints(self) -> tuple[FloatArray, Way, float]:
        path = WaypointPath(np.array([(*point, 0.0)[:3] for point in self.waypoints_m]))
        drive = Drive(path.length_m, self.stand_s, self.ramp_s, self.speed_mps)
        if drive.length_m < self.speed_mps * self.ramp_s:
            raise PluginError(
                f"dataset path: the path is {drive.length_m:.1f} m long, but two ramps of {self.ramp_s} s to"
                f" {self.speed_mps} m/s need {self.speed_mps * self.ramp_s:.1f} m; decrease ramp_s or speed_mps."
            )
        t_s = self._times(drive.duration_s)
        return t_s, path.driven(t_s, drive), self.stand_s

    def _table(self) -> tuple[FloatArray, Way, float]:
        table = _read_table(self._path)
        table_t_s = table[:, 0] - table[0, 0]
        t_s = self._times(table_t_s[-1])
        if len(t_s) <= self.imu_rate_hz / self.gnss_rate_hz:
            raise RecordingError(
                f"{self._path} lasts {table_t_s[-1]:g} s, which is shorter than the interval between fixes; use a"
                " longer trajectory or increase gnss_rate_hz."
            )
        curve = table_curve(table_t_s, table[:, 1:], self.smoothing_m)
        way, moving = curve_way(t_s, curve, self.course_min_speed_mps)
        if not moving.any():
            raise RecordingError(
                f"{self._path} is never faster than {self.course_min_speed_mps} m/s, so it has no course; decrease"
                " course_min_speed_mps."
            )
        still = np.linalg.norm(way.velocity_mps, axis=1) <= STILL_MPS
        return t_s, way, float(t_s[np.argmin(still)])


def _require_path(waypoints_m: tuple[tuple[float, ...], ...]) -> None:
    """Raise a PluginError unless there are at least two finite waypoints, and consecutive waypoints differ."""
    fits = all(len(point) in (2, 3) and np.isfinite(point).all() for point in waypoints_m)
    if len(waypoints_m) < 2 or not fits or len({len(point) for point in waypoints_m}) > 1:
        raise PluginError(
            f"dataset path: waypoints_m is {waypoints_m}; give two or more waypoints of finite numbers, all (east,"
            " north) or all (east, north, up)."
        )
    same = np.flatnonzero(~np.diff(np.array(waypoints_m), axis=0).any(axis=1))
    if same.size:
        raise PluginError(
            f"dataset path: waypoints {same[0]} and {same[0] + 1} of waypoints_m have the same position; remove one of"
            " these two waypoints."
        )


def _read_table(path: Path) -> FloatArray:
    """Return the rows (k, 4) of a trajectory file: t [s], east, north, up [m]."""
    columns = read_columns([path], TextFormat())
    table = columns.finite("1234")
    columns.stamped(columns.stamps_ns("1", "s")).require_increasing()
    if len(table) < 4:
        raise RecordingError(f"{path} has {len(table)} positions; a spline needs at least 4 positions.")
    return table
