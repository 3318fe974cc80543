"""Hand-held IMUs with optical motion capture as the reference of the attitude: BROAD and RepoIMU."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import best_rotation, dcm_from_euler, euler_from_quaternion, roll_pitch
from jerkbench.io.columns import TextFormat
from jerkbench.io.conversions import calibrated_at_rest
from jerkbench.io.files import FromFiles, named_folder, require_content
from jerkbench.io.readers import read_columns, stored_array
from jerkbench.io.sanitiser import require_possible, unit_quaternions
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording, Reference

# A trial of BROAD: a hand-held IMU with optical motion capture, as HDF5 or as a MATLAB file.

_COLUMNS = {"imu_acc": 3, "imu_gyr": 3, "opt_quat": 4, "movement": 1}
"""Fields that are read, and the number of columns of each field. Magnetometer and optical position are not read."""

_MAX_VALUES = {"imu_acc": 1e3, "imu_gyr": 1e2, "opt_quat": 2.0, "movement": 1.0}
"""Maximum plausible magnitude: specific force [m/s2], angular rate [rad/s], quaternion and movement flag [-]."""

MIN_SAMPLES = 2


class BroadTrial(NamedTuple):
    """The measurements of a trial, in the axes of the sensor.

    Attributes:
        rate_hz: sampling rate of the IMU [Hz].
        accel_mps2: (n, 3) specific force [m/s2].
        gyro_radps: (n, 3) angular rate [rad/s].
        quaternion_wxyz: (n, 4) rotation from the sensor to ENU, or NaN if the markers were not visible.
        movement: (n,) True if the sample belongs to the movement, so that errors at this sample are scored.
    """

    rate_hz: float
    accel_mps2: FloatArray
    gyro_radps: FloatArray
    quaternion_wxyz: FloatArray
    movement: BoolArray


def read_broad_trial(path: Path) -> BroadTrial:
    """Read the file of a trial, which ends in .hdf5 or .mat.

    Raises:
        RecordingError: the file does not exist or is damaged, or a field is missing or has a wrong shape. The message
            names the file and the field.
    """
    require_content(path)
    kind = "a MATLAB file (version 5)" if path.suffix == ".mat" else "an HDF5 file"
    try:
        fields = _fields(path)
    except RecordingError:
        raise
    except Exception as error:  # scipy and h5py raise undocumented errors for damaged files
        reason = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{path} cannot be read as {kind} ({reason}); copy the file again.") from error
    samples = len(np.atleast_1d(fields.get("imu_acc", ())))
    accel, gyro, attitude, movement = (_array(path, fields, name, samples) for name in _COLUMNS)
    rate = _numbers(path, fields, "sampling_rate")
    if rate.size != 1 or not 0 < rate.item() < np.inf:
        raise RecordingError(f"{path}: sampling_rate is {fields.get('sampling_rate')}; it must be a positive number.")
    return BroadTrial(rate.item(), accel, gyro, attitude, movement[:, 0] > 0)


def _fields(path: Path) -> dict[str, Any]:
    import h5py
    from scipy.io import loadmat

    if path.suffix == ".mat":
        return dict(loadmat(path, variable_names=[*_COLUMNS, "sampling_rate"]))
    with h5py.File(path) as file:
        return {name: stored_array(path, file[name]) for name in _COLUMNS if name in file} | dict(file.attrs)


def _array(path: Path, fields: Mapping[str, Any], name: str, samples: int) -> FloatArray:
    columns = _COLUMNS[name]
    if name not in fields:
        raise RecordingError(f"{path} has no field {name}; a trial of BROAD has the fields {', '.join(_COLUMNS)}.")
    array, wanted = _numbers(path, fields, name), (samples, columns)
    if array.size != samples * columns or len(array) != samples or samples < MIN_SAMPLES:
        raise RecordingError(
            f"{path}: {name} has shape {array.shape}; it must be of shape {wanted}, with {MIN_SAMPLES} or more rows."
        )
    require_possible(f"{path}, {name}", array, _MAX_VALUES[name])
    return array.reshape(wanted)


def _numbers(path: Path, fields: Mapping[str, Any], name: str) -> FloatArray:
    try:
        return np.asarray(fields.get(name), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{path}: {name} is not numeric; it must contain numbers.") from error


ENDINGS = (".hdf5", ".mat")
STILL_MARGIN_S = 1.0
"""Margin between the end of the first rest and the marked movement [s], because the hand touches the sensor earlier."""

_NOTES = (
    "The recording has neither position nor heading: only the tilt is estimated, and yaw is not scored.",
    "Rows are scored if the trial is marked as movement and the optical attitude is known.",
)


@register("dataset", "broad")
@dataclass(frozen=True)
class Broad(FromFiles):
    """A trial of BROAD: tilt of a hand-held IMU, with optical motion capture as the reference.

    The IMU is at rest for half a minute, is then moved by hand, and is at rest again. The sampling rate is 285.7 Hz.
    The filter ``attitude_only`` runs an attitude filter on the trial, and the metric `inclination` computes the tilt
    error::

        jerkbench run -m dataset=broad dataset.trial=7,16 attitude=real,gyro_only filter=attitude_only

    The axes of the sensor are used as body axes. The yaw of the reference is NaN, because the magnetometer is not read
    and no filter can estimate the yaw without a heading.

    Source: D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation
    Estimation", Data 6(7), 2021, doi:10.3390/data6070072; github.com/dlaidig/broad (CC BY 4.0).

    Attributes:
        folder: folder of the trials, or empty for the folder of `jerkbench data fetch broad`.
        trial: number of the trial. The name of the file of the trial (.hdf5 or .mat) starts with this number.
        remove_gyro_bias: whether to subtract the gyro's mean over the first rest.
    """

    attitude_only: ClassVar[bool] = True

    folder: str = ""
    trial: int = 16
    remove_gyro_bias: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the trial. ``seed`` has no effect.

        Raises:
            RecordingError: the file is missing or damaged, or ``remove_gyro_bias`` is True and the trial does not start
                with a rest.
        """
        (path,) = self.paths()
        trial = read_broad_trial(path)
        t_s = np.arange(len(trial.movement)) / trial.rate_hz
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def paths(self) -> tuple[Path, ...]:
        """Return the path of the file of the trial."""
        folder = named_folder(self.folder or "fetched:broad")
        if not folder.is_dir():
            raise RecordingError(f"There is no folder {folder}; give the folder that the trials were copied to.")
        trials = sorted(path for path in folder.iterdir() if path.suffix in ENDINGS and path.is_file())
        named = [path for path in trials if path.name.startswith(f"{self.trial:02d}_")]
        if len(named) == 1:
            return (named[0],)
        names = ", ".join(path.name for path in (named or trials)) or "no .hdf5 or .mat file"
        raise RecordingError(
            f"{folder} has {len(named)} files whose names start with '{self.trial:02d}_' (trial {self.trial}), but"
            f" exactly one is needed. Available: {names}."
        )


def recording_of(name: str, t_s: FloatArray, trial: BroadTrial, *, remove_gyro_bias: bool) -> Recording:
    """Return the recording of a trial with stamps ``t_s`` (n,)."""
    first = int(np.argmax(trial.movement)) if trial.movement.any() else len(trial.movement)
    rest_s = max(first / trial.rate_hz - STILL_MARGIN_S, 0.0)
    imu = Imu(t_s, trial.accel_mps2, trial.gyro_radps)
    return Recording(
        name=name,
        imu=calibrated_at_rest(imu, rest_s, gyro=remove_gyro_bias, accel=False),
        reference=_reference(name, t_s, trial),
        static_start_s=rest_s,
        notes=_NOTES,
    )


def _reference(name: str, t_s: FloatArray, trial: BroadTrial) -> Reference:
    known = unit_quaternions(trial.quaternion_wxyz)
    if not known.any():
        raise RecordingError(f"{name} has no optical attitude, because no quaternion has norm 1; copy the file again.")
    euler_rad = np.full((len(t_s), 3), np.nan)
    euler_rad[known, :2] = euler_from_quaternion(trial.quaternion_wxyz[known])[:, :2]
    scored, source = trial.movement & known, "optical motion capture"
    return Reference(t_s, source, independent=True, euler_rad=euler_rad, scored=scored)


# The TStick of RepoIMU: a hand-held stick with an IMU and optical motion capture, as Parquet files.

RATE_HZ = 100.0
SATURATED_RADPS = 7.3
"""Samples with an angular rate above this threshold are treated as saturated [rad/s]."""

WINDOW_S, SOUND = 10.0, 0.05
"""Length [s] over which the specific force is averaged, and maximum relative difference of the average from gravity."""

_ACCEL, _GYRO, _ATTITUDE = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["qw", "qx", "qy", "qz"]


@register("dataset", "repoimu")
@dataclass(frozen=True)
class RepoImu(FromFiles):
    """A trial of RepoIMU's TStick: tilt of a hand-held stick at 100 Hz, with optical motion capture as the reference.

    The stick is at rest for two to four seconds and is then swung by hand for a minute and a half. In the published
    data, the body axes of the reference are rotated by 2.8 degrees relative to the IMU, and the frame of the reference
    is tilted by 1.7 degrees. Without a correction, these misalignments of the reference would add the same error to
    every filter. The rotation B of the body axes and the rotation T of the frame are constant, and are estimated
    without a filter from the gyro samples y_G,k, the accelerometer samples y_A,k, and the attitudes q_k of the
    reference::

        B = the rotation with the least sum of |w_k - B y_G,k|^2,  w_k the angular rate of the reference
        T u = e3,  u = mean of q_k B y_A,k, normalised;   reference = T q_k B

    After an occlusion of markers (Test05), the attitude of the reference is wrong for up to a minute. A hand does not
    accelerate for ten seconds, so the mean of q_k y_A,k over ten seconds is equal to gravity if the attitudes q_k are
    correct. A sample is scored only if the norm of this mean, over the ten seconds around the sample, differs from
    gravity by less than 5 %. In Test05, the gyro saturates at 7.36 rad/s.

    Each trial is a Parquet file, for example ``TStick_Test02_Trial1.parquet``. The file has the columns t_s [s]; ax,
    ay, az [m/s2] and gx, gy, gz [rad/s] in the axes of the sensor; the quaternion qw, qx, qy, qz of the rotation from
    the sensor to a frame whose z axis is up; and movement (1 if the row is scored). The original data have no stated
    licence, so `jerkbench data fetch` does not offer them. To use the data set, convert the published CSV files to
    Parquet files with the columns above.

    Source: A. Szczesna and others, Annals of Computer Science and Information Systems 8, 2016;
    github.com/agnieszkaszczesna/RepoIMU.

    Attributes:
        folder: folder of the trials.
        test: number of the test.
        trial: number of the trial within the test.
        remove_gyro_bias: whether to subtract the gyro's mean over the first rest.
        align_reference: whether to correct the attitude of the reference by the rotations T and B, and to score only
            samples with a valid reference.
    """

    attitude_only: ClassVar[bool] = True

    folder: str = ""
    test: int = 2
    trial: int = 1
    remove_gyro_bias: bool = True
    align_reference: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the trial. ``seed`` has no effect.

        Raises:
            RecordingError: the file is missing or damaged, or lacks a column.
        """
        (path,) = self.paths()
        columns = read_columns((path,), TextFormat())
        if len(columns) < MIN_SAMPLES:
            raise RecordingError(f"{path} has {len(columns)} rows; a trial needs at least {MIN_SAMPLES} rows.")
        accel, gyro, attitude = map(columns.numbers, (_ACCEL, _GYRO, _ATTITUDE))
        t_s, movement = columns.numbers(["t_s", "movement"]).T
        t_s, trial = t_s - t_s[0], BroadTrial(RATE_HZ, accel, gyro, attitude, movement > 0)
        if self.align_reference:
            without_bias = recording_of(path.stem, t_s, trial, remove_gyro_bias=True).inertial
            trial = aligned(trial, without_bias)
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def paths(self) -> tuple[Path, ...]:
        """Return the path of the file of the trial."""
        return (named_folder(self.folder) / f"TStick_Test{self.test:02d}_Trial{self.trial}.parquet",)


def aligned(trial: BroadTrial, imu: Imu) -> BroadTrial:
    """Align the reference of a trial with the IMU and with gravity, and score only samples with a valid reference."""
    from scipy.ndimage import uniform_filter1d

    known = unit_quaternions(trial.quaternion_wxyz)
    q = Rotation.from_quat(np.where(known[:, None], trial.quaternion_wxyz, [1.0, 0.0, 0.0, 0.0]), scalar_first=True)
    accel, gyro = imu.accel_mps2.copy(), imu.gyro_radps[1:]
    mean = uniform_filter1d(q.apply(accel), round(WINDOW_S * RATE_HZ), axis=0, mode="nearest")
    sound = known & (np.abs(np.linalg.norm(mean, axis=1) / GRAVITY_MPS2 - 1) < SOUND)
    rate: FloatArray = (q[:-1].inv() * q[1:]).as_rotvec() * RATE_HZ
    use = sound[1:] & sound[:-1] & (np.abs(gyro).max(axis=1) < SATURATED_RADPS)
    if not use.any():
        raise RecordingError(
            "The reference cannot be aligned: the mean specific force, rotated by the attitude of the reference, never"
            " has the magnitude of gravity. Set align_reference=false."
        )
    rotated = q * Rotation.from_matrix(best_rotation(rate[use], gyro[use]))
    up = rotated.apply(accel)[sound].mean(axis=0)
    upright = Rotation.from_matrix(dcm_from_euler(np.array([*roll_pitch(up), 0.0])))
    reference = np.where(known[:, None], (upright * rotated).as_quat(scalar_first=True), np.nan)
    return trial._replace(quaternion_wxyz=reference, movement=trial.movement & sound)
