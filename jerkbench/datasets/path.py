"""Any path driven: a spline through waypoints, or through a recorded trajectory."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.files import fingerprint
from jerkbench.io.text import parse_numbers, read_lines, require_increasing
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Recording
from jerkbench.simulation.motion import Drive, Way, WaypointPath, curve_way, table_curve
from jerkbench.simulation.sensors import Sensors
from jerkbench.simulation.truth import Truth, draw_vibration

STILL_MPS = 0.01
"""What is slower than this at the start of a table stands."""


@register("dataset", "path")
@dataclass(frozen=True)
class DrivenPath(Sensors):
    """A simulated vehicle that drives a given path: waypoints, or a recorded trajectory.

    Waypoints: a cubic spline r(u) through them, u the sum of the straight distances. The vehicle stands, ramps up to
    its speed, and ramps down to stop at the last waypoint (quintic smoothsteps).

    Trajectory: a CSV file, each line t, east, north, up [s, m], an optional line of names above. A cubic spline over
    time goes through its places or, with ``smoothing_m``, near them. The motion is the file's own, from its first
    time on, which becomes 0. So a real drive can be simulated with known noise.

    The vehicle points along its path: yaw = atan2(v_n, v_e), pitch = -atan(climb), roll = 0; it does not reverse.
    Where a trajectory is slower than ``course_min_speed_mps``, yaw and pitch go straight from before to after.
    Vibration is true motion, as in `field`; it grows from the first movement on. The ground is as even as the path
    itself. The sensors are those of every simulated vehicle, below.

    Attributes:
        waypoints_m: east, north, or east, north, up of each; used where there is no ``file``.
        file: the CSV file; relative to where the command runs. Empty: the waypoints.
        stand_s: how long it stands at the start; of waypoints only.
        ramp_s: how long it takes to its speed; of a trajectory: the vibration to its strength.
        speed_mps: along the waypoints.
        smoothing_m: standard deviation of the file's places on each axis; 0: they are exact.
        course_min_speed_mps: horizontal speed above which a trajectory has a course.
        vibration_mps2: rms of the vertical vibration; east and north have .7 of it.
        vibration_rad: rms of the vibration of roll, of pitch and of yaw.
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
        """Check that every number makes sense, and that the waypoints are a path."""
        subject = "dataset path"
        self.check_sensors(subject)
        require_positive(subject, self, ("ramp_s", "speed_mps", "course_min_speed_mps"))
        require_not_negative(subject, self, ("stand_s", "smoothing_m", "vibration_mps2", "vibration_rad"))
        if not self.file:
            _require_path(self.waypoints_m)

    def load(self, seed: int) -> Recording:
        """Return the drive with the noise that belongs to ``seed``.

        Raises:
            PluginError: the waypoints are too near for the ramps.
            RecordingError: the file is missing or damaged, or it holds no drive.
        """
        truth, rest_s = self.truth(seed)
        return self.record(Path(self.file).stem if self.file else "path", truth, seed, rest_s)

    def fingerprint(self) -> str:
        """Return the SHA-256 over the file's bytes; empty without a file."""
        if not self.file:
            return ""
        if not self._path.is_file():
            raise RecordingError(f"There is no file {self._path}; correct 'file' or leave it out for the waypoints.")
        return fingerprint((self._path,))

    def truth(self, seed: int) -> tuple[Truth, float]:
        """Return the true motion from t = 0 on, at the IMU's rate, and how long it stands at the start [s]."""
        t_s, way, rest_s = self._table() if self.file else self._waypoints()
        sizes = (self.heard("vibration", size) for size in (self.vibration_mps2, self.vibration_rad))
        vibration = draw_vibration(stream(seed, "dataset", "vibration"), *sizes)
        shaking = vibration.grown(t_s, rest_s, self.ramp_s)
        return Truth(t_s, *(own + more for own, more in zip(way, shaking, strict=True))), rest_s

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
                f"dataset path: the path is {drive.length_m:.1f} m long; two ramps of {self.ramp_s} s to"
                f" {self.speed_mps} m/s need {self.speed_mps * self.ramp_s:.1f} m: lower ramp_s or speed_mps."
            )
        t_s = self._times(drive.duration_s)
        return t_s, path.driven(t_s, drive), self.stand_s

    def _table(self) -> tuple[FloatArray, Way, float]:
        table = _read_table(self._path)
        table_t_s = table[:, 0] - table[0, 0]
        t_s = self._times(table_t_s[-1])
        if len(t_s) <= self.imu_rate_hz / self.gnss_rate_hz:
            raise RecordingError(f"{self._path} lasts {table_t_s[-1]:g} s, which is too short for a fix; give more.")
        curve = table_curve(table_t_s, table[:, 1:], self.smoothing_m)
        way, moving = curve_way(t_s, curve, self.course_min_speed_mps)
        if not moving.any():
            raise RecordingError(
                f"{self._path} is never faster than {self.course_min_speed_mps} m/s, so that it has no course; lower"
                " course_min_speed_mps."
            )
        still = np.linalg.norm(way.velocity_mps, axis=1) <= STILL_MPS
        return t_s, way, float(t_s[np.argmin(still)])


def _require_path(waypoints_m: tuple[tuple[float, ...], ...]) -> None:
    """Raise a PluginError unless there are two waypoints or more, all finite, no two in a row at the same place."""
    fits = all(len(point) in (2, 3) and np.isfinite(point).all() for point in waypoints_m)
    if len(waypoints_m) < 2 or not fits or len({len(point) for point in waypoints_m}) > 1:
        raise PluginError(
            f"dataset path: waypoints_m is {waypoints_m}; give two or more, each east, north (or each east, north, up)."
        )
    same = np.flatnonzero(~np.diff(np.array(waypoints_m), axis=0).any(axis=1))
    if same.size:
        raise PluginError(
            f"dataset path: waypoints {same[0]} and {same[0] + 1} of waypoints_m are the same place; remove one."
        )


def _read_table(path: Path) -> FloatArray:
    """Return (k, 4) t, east, north, up."""
    lines = read_lines(path)
    if any(letter in lines[0][1] for letter in "tTeEnNxX") and not lines[0][1].lstrip(" +-.")[:1].isdigit():
        lines = lines[1:]
    table = parse_numbers(path, lines, 4, ",")
    require_increasing(path, lines, table[:, 0], "the time")
    if len(table) < 4:
        raise RecordingError(f"{path} has {len(table)} places; a spline needs 4 or more.")
    return table
