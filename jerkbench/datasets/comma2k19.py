"""The data set `comma2k19`: one minute of a car with IMU and receiver of a phone-like device, and with wheel speed."""

from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, require_positive
from jerkbench.errors import RecordingError
from jerkbench.geometry import ecef_to_enu, enu_axes, euler_from_dcm, wrap_angle
from jerkbench.io.conversions import UNIX_EPOCH, body_from_sensor, in_enu
from jerkbench.io.files import NO_ARRAY, FromFiles, named_folder, require_content
from jerkbench.io.sanitiser import MAX_NUMBER, possible_rows, require_possible, steady_rows
from jerkbench.plugins import register
from jerkbench.recording import Heading, Imu, Origin, Position, Recording, Reference, Velocity

# The files of a segment (one minute) of comma2k19 contain NumPy arrays and have no suffix.

_POSE, _LOG = "global_pose", "processed_log"
_GROUPS: dict[str, dict[str, tuple[int, float]]] = {
    _POSE: {
        "frame_times": (1, MAX_NUMBER),
        "frame_positions": (3, MAX_NUMBER),
        "frame_velocities": (3, 2e2),
        "frame_orientations": (4, MAX_NUMBER),
    },
    f"{_LOG}/IMU": {"accelerometer/t": (1, MAX_NUMBER), "accelerometer/value": (3, 1e3), "gyro/value": (3, 1e2)},
    f"{_LOG}/GNSS/live_gnss_ublox": {"t": (1, MAX_NUMBER), "value": (6, MAX_NUMBER)},
    f"{_LOG}/CAN/speed": {"t": (1, MAX_NUMBER), "value": (1, 2e2)},
}
"""For each array that is read: its number of columns, and its maximum plausible value [m/s2, rad/s, m/s, m]. The arrays
of a folder have the same number of rows."""


class CommaSegment(NamedTuple):
    """The arrays of a segment. All stamps are seconds since the device started.

    Attributes:
        frame_log_s: (k,) stamps of the camera frames, which are the stamps of the reference [s].
        frame_ecef_m: (k, 3) position of the reference in ECEF [m].
        frame_ecef_mps: (k, 3) velocity of the reference in ECEF [m/s].
        frame_wxyz: (k, 4) quaternion of the rotation from the device (forward, right, down) to ECEF.
        imu_log_s: (n,) stamps of the IMU [s].
        accel_mps2: (n, 3) specific force (forward, right, down) [m/s2].
        gyro_radps: (n, 3) angular rate (forward, right, down), minus the bias estimated by the device [rad/s].
        gnss_log_s: (m,) times at which the fixes were logged [s].
        gnss: (m, 6) latitude, longitude [deg], speed [m/s], UTC [ms], ellipsoidal height [m], bearing [deg].
        wheel_log_s: (w,) stamps of the wheel speed [s].
        wheel_mps: (w,) wheel speed on the CAN bus of the car [m/s].
    """

    frame_log_s: FloatArray
    frame_ecef_m: FloatArray
    frame_ecef_mps: FloatArray
    frame_wxyz: FloatArray
    imu_log_s: FloatArray
    accel_mps2: FloatArray
    gyro_radps: FloatArray
    gnss_log_s: FloatArray
    gnss: FloatArray
    wheel_log_s: FloatArray
    wheel_mps: FloatArray


def read_comma_segment(folder: Path) -> CommaSegment:
    """Read a segment from the folder that contains global_pose and processed_log.

    Raises:
        RecordingError: a file is missing or is not a NumPy array, or the shapes of the arrays do not match.
    """
    arrays: list[FloatArray] = []
    for group, files in _GROUPS.items():
        read = {f"{group}/{name}": _read(folder / group / name, *limits) for name, limits in files.items()}
        lengths = set(map(len, read.values()))
        if len(lengths) > 1 or min(lengths) < 2:
            counts = ", ".join(f"{len(array)} ({name})" for name, array in read.items())
            raise RecordingError(
                f"{folder}: the arrays must have the same number of rows, at least 2, but the numbers of rows are"
                f" {counts}; copy the segment again."
            )
        arrays += read.values()
    return CommaSegment(*arrays)


def _read(path: Path, columns: int, most: float) -> FloatArray:
    require_content(path)
    try:
        array = np.asarray(np.load(path, mmap_mode="r", allow_pickle=False), dtype=np.float64)
    except NO_ARRAY as error:
        raise RecordingError(f"{path} cannot be read as a NumPy array ({error}); copy the file again.") from error
    table = array.reshape(len(array), -1) if array.ndim in (1, 2) and array.size else np.empty((0, 0))
    if table.shape[1] != columns:
        raise RecordingError(f"{path} has shape {array.shape}; it must have {columns} columns.")
    if not np.isfinite(table).all():
        raise RecordingError(f"{path} contains NaN or infinity; copy the file again.")
    require_possible(str(path), table, most)
    return table[:, 0] if columns == 1 else table


DEVICE_SIGNS = (1.0, -1.0, -1.0)
"""The device's axes are forward, right, down."""

FLU_SIGNS = (1.0, 1.0, 1.0)

_SOURCE = "the vendor's optimiser over INS, GNSS and vision (decimetres), which shares the receiver"
_FITTED = (
    "The defaults of mounting, wheel scale and age of the fixes were fitted on the reference of the public minute"
    " Example_1."
)
_NOTES = (
    "The fixes have no covariance: position_sigma_m is used for all of them; their errors are correlated over seconds.",
)


@register("dataset", "comma2k19")
@dataclass(frozen=True)
class Comma2k19(FromFiles):
    """A minute of comma2k19: a car at 8 to 20 m/s, with its wheel speed and a reference that is not the fixes.

    The defaults are for ``Example_1`` of github.com/commaai/comma2k19 (MIT). Time 0 is the first IMU sample. The times
    at which fixes were logged jitter by -20 to +39 ms. Each log time is replaced by a linear least-squares fit of the
    log time as a function of the receiver's UTC::

        t_fix = a UTC + b - position_age;    t_course = a UTC + b - course_age

    The x axis of the body is the direction of travel. In the axes of the device, this direction is Rz(yaw) Ry(pitch) x,
    with the mounting yaw and the mounting pitch of the device::

        f_body = (Rz(yaw) Ry(pitch))' diag(1, -1, -1) f_device                  and the same for the gyro

    The wheel speed, multiplied by ``wheel_scale``, is a `Velocity` along the course. Above ``course_min_speed_mps``,
    the bearing of the receiver is a heading with the source "course". The car already moves at the start, so the tilt
    cannot be estimated at rest, and the filters start with a level body. Fixes that leap (are far from neighbouring
    fixes) are dropped. The origin of ENU is the first fix that is not dropped.

    Source: H. Schafer, E. Santana, A. Haden, R. Biasini, "A Commute in Data: The comma2k19 Dataset", arXiv:1812.05752.

    Attributes:
        folder: folder with global_pose and processed_log, or empty for the folder of `jerkbench data fetch comma2k19`.
        mounting_yaw_deg: yaw of the direction of travel in the axes of the device, positive to the left [deg].
        mounting_pitch_deg: pitch of the direction of travel in the axes of the device, negative upwards [deg].
        position_age_s: time from the validity of a fix to its fitted log time [s].
        position_sigma_m: standard deviation of a fix on each axis [m].
        course_age_s: time from the validity of the bearing to its fitted log time [s].
        course_sigma_deg: standard deviation of the bearing [deg].
        course_min_speed_mps: speed of the receiver below which the bearing is dropped [m/s].
        wheel: whether the recording contains the wheel speed.
        wheel_scale: ratio of the true speed to the wheel speed [-].
        wheel_sigma_mps: standard deviation of the wheel speed [m/s]. This value is larger than the noise of the wheel
            speed, because the noise is correlated in time.
        across_sigma_mps: standard deviation of the velocity across the course [m/s], which is assumed to be zero
            (non-holonomic constraint), or null for no such constraint.
    """

    folder: str = ""
    mounting_yaw_deg: float = -0.81
    mounting_pitch_deg: float = -3.81
    position_age_s: float = 0.083
    position_sigma_m: float = 0.5
    course_age_s: float = 0.15
    course_sigma_deg: float = 0.5
    course_min_speed_mps: float = 1.0
    wheel: bool = True
    wheel_scale: float = 1.0087
    wheel_sigma_mps: float = 0.5
    across_sigma_mps: float | None = None

    def __post_init__(self) -> None:
        names = ("position_sigma_m", "course_sigma_deg", "wheel_scale", "wheel_sigma_mps")
        across = () if self.across_sigma_mps is None else ("across_sigma_mps",)
        require_positive("dataset comma2k19", self, (*names, *across))

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the segment. ``seed`` has no effect.

        Raises:
            RecordingError: a file is missing or damaged.
        """
        segment = read_comma_segment(named_folder(self.folder or "fetched:comma2k19"))
        fixes, notes = possible_rows("GNSS", places=segment.gnss[:, [0, 1, 4]], utc_ns=segment.gnss[:, 3] * 1e6)
        frames, off = possible_rows(_POSE, places=segment.frame_ecef_m, frame="ecef")
        of_frames = {name: getattr(segment, name)[frames] for name in segment._fields if name.startswith("frame")}
        segment = segment._replace(gnss=segment.gnss[fixes], gnss_log_s=segment.gnss_log_s[fixes], **of_frames)
        line = _clock(segment)
        position, origin, leaps = self._fixes(segment, line)
        of_segment = ("mounting_yaw_deg", "mounting_pitch_deg", "wheel_scale", "position_age_s")
        fitted = any(getattr(self, name) == getattr(type(self), name) for name in of_segment)
        begin_s = float((segment.imu_log_s[0] - line[1]) / line[0])  # time from the first fix to the first IMU sample
        return Recording(
            name="comma2k19",
            imu=self._imu(segment),
            reference=self._reference(segment, origin),
            position=position,
            velocity=self._wheel(segment) if self.wheel else None,
            heading=self._course(segment, line),
            origin=origin,
            start_utc=UNIX_EPOCH + timedelta(milliseconds=float(segment.gnss[0, 3]), seconds=begin_s),
            notes=(*notes, *off, *leaps, *_NOTES, *((_FITTED,) if fitted else ())),
        )

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of all files of the segment.

        Raises:
            RecordingError: a file is missing.
        """
        folder = named_folder(self.folder or "fetched:comma2k19")
        paths = tuple(folder / group / name for group, files in _GROUPS.items() for name in files)
        missing = [path for path in paths if not path.is_file()]
        if missing:
            raise RecordingError(
                f"There is no file {missing[0]}; set folder to the folder of a segment, which contains"
                f" {_POSE} and {_LOG}."
            )
        return paths

    def _imu(self, segment: CommaSegment) -> Imu:
        turn = body_from_sensor(DEVICE_SIGNS, self.mounting_yaw_deg, self.mounting_pitch_deg)
        t_s = segment.imu_log_s - segment.imu_log_s[0]
        return Imu(t_s, segment.accel_mps2 @ turn.T, segment.gyro_radps @ turn.T)

    def _fixes(self, segment: CommaSegment, line: FloatArray) -> tuple[Position, Origin, tuple[str, ...]]:
        """Return the fixes that do not leap, the first of these fixes as the origin, and notes about dropped fixes."""
        t_s = _utc_s(segment) @ line - segment.imu_log_s[0] - self.position_age_s
        places = segment.gnss[:, [0, 1, 4]]
        steady, notes = steady_rows("GNSS", t_s, places)
        origin = Origin(*places[steady][0].tolist())
        enu_m = in_enu(places[steady], "geodetic", origin)
        covariance = np.tile(self.position_sigma_m**2 * np.eye(3), (len(enu_m), 1, 1))
        return Position(t_s[steady], enu_m, covariance), origin, notes

    def _wheel(self, segment: CommaSegment) -> Velocity:
        t_s = segment.wheel_log_s - segment.imu_log_s[0]
        speed = self.wheel_scale * segment.wheel_mps
        return Velocity.along_course(t_s, speed, self.wheel_sigma_mps, self.across_sigma_mps)

    def _course(self, segment: CommaSegment, line: FloatArray) -> Heading:
        fast = segment.gnss[:, 2] >= self.course_min_speed_mps
        t_s = (_utc_s(segment) @ line)[fast] - segment.imu_log_s[0] - self.course_age_s
        yaw_rad = wrap_angle(np.radians(90.0 - segment.gnss[fast, 5]))
        return Heading(t_s, yaw_rad, np.full(len(t_s), np.radians(self.course_sigma_deg)), "course")

    def _reference(self, segment: CommaSegment, origin: Origin) -> Reference:
        from scipy.spatial.transform import Rotation

        turn = enu_axes(origin)
        device = Rotation.from_quat(segment.frame_wxyz, scalar_first=True).as_matrix() @ np.diag(DEVICE_SIGNS)
        body_from_device = body_from_sensor(FLU_SIGNS, self.mounting_yaw_deg, self.mounting_pitch_deg)
        t_s, enu_m = segment.frame_log_s - segment.imu_log_s[0], ecef_to_enu(segment.frame_ecef_m, origin)
        motion = segment.frame_ecef_mps @ turn.T, euler_from_dcm(turn @ device @ body_from_device.T)
        return Reference(t_s, _SOURCE, False, enu_m, *motion)  # noqa: FBT003 - not independent


def _utc_s(segment: CommaSegment) -> FloatArray:
    """Return the design matrix (m, 2) of the linear fit: UTC since the first fix [s], and ones."""
    return np.column_stack([(segment.gnss[:, 3] - segment.gnss[0, 3]) * 1e-3, np.ones(len(segment.gnss))])


def _clock(segment: CommaSegment) -> FloatArray:
    """Return the coefficients a and b (2,) of the linear fit log time = a UTC + b.

    Raises:
        RecordingError: the UTC of the fixes does not increase.
    """
    back = np.flatnonzero(np.diff(segment.gnss[:, 3]) <= 0)
    if back.size:
        raise RecordingError(
            f"The UTC of fix {back[0] + 1} is not later than the UTC of the previous fix; copy the segment again."
        )
    line, *_ = np.linalg.lstsq(_utc_s(segment), segment.gnss_log_s, rcond=None)
    return np.asarray(line)
