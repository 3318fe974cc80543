"""Hand-held IMUs beside optical motion capture, where the attitude is all there is to estimate: BROAD, RepoIMU."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import best_rotation, dcm_from_euler, euler_from_quaternion, roll_pitch
from jerkbench.io.columns import hdf5_arrays, load_matlab_5, read_columns
from jerkbench.io.files import FromFiles, named_folder, recording_folder
from jerkbench.io.frames import without_gyro_bias
from jerkbench.io.sanitiser import unit_quaternions
from jerkbench.io.text import TextFormat, require_content, require_possible
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording, Reference

# A trial of BROAD: a hand-held IMU beside optical motion capture, as HDF5 or as a MATLAB file.

_COLUMNS = {"imu_acc": 3, "imu_gyr": 3, "opt_quat": 4, "movement": 1}
"""Fields that are read, and how many columns each has; magnetometer and optical position are left alone."""

_MAX_VALUES = {"imu_acc": 1e3, "imu_gyr": 1e2, "opt_quat": 2.0, "movement": 1.0}
"""The largest possible values [m/s2, rad/s]; larger ones are damage."""

MIN_SAMPLES = 2


class BroadTrial(NamedTuple):
    """A trial in the sensor's own axes.

    Attributes:
        rate_hz: samples a second.
        accel_mps2: (n, 3) specific force.
        gyro_radps: (n, 3) angular rate.
        quaternion_wxyz: (n, 4) ENU <- sensor; NaN where markers were lost.
        movement: (n,) whether the sample belongs to the movement, which is what counts.
    """

    rate_hz: float
    accel_mps2: FloatArray
    gyro_radps: FloatArray
    quaternion_wxyz: FloatArray
    movement: BoolArray


def read_broad_trial(path: Path) -> BroadTrial:
    """Read ``path``, which ends in .hdf5 or .mat.

    Raises:
        RecordingError: no such file, it is damaged, or a field is missing or has another shape; names file and field.
    """
    require_content(path)
    kind = "a MATLAB file (version 5)" if path.suffix == ".mat" else "an HDF5 file"
    try:
        fields = _fields(path)
    except RecordingError:
        raise
    except Exception as error:  # scipy and h5py document none of what a damaged file makes them raise
        reason = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{path} cannot be read as {kind} ({reason}); copy it again.") from error
    samples = len(np.atleast_1d(fields.get("imu_acc", ())))
    accel, gyro, attitude, movement = (_array(path, fields, name, samples) for name in _COLUMNS)
    return BroadTrial(_rate(path, fields), accel, gyro, attitude, movement[:, 0] > 0)


def _fields(path: Path) -> dict[str, Any]:
    import h5py

    if path.suffix == ".mat":
        return load_matlab_5(path, variable_names=[*_COLUMNS, "sampling_rate"])
    with h5py.File(path) as file:
        return {**hdf5_arrays(path, file), "sampling_rate": file.attrs.get("sampling_rate")}


def _array(path: Path, fields: Mapping[str, Any], name: str, samples: int) -> FloatArray:
    columns = _COLUMNS[name]
    if name not in fields:
        raise RecordingError(f"{path} has no field {name}; a trial of BROAD has {', '.join(_COLUMNS)}.")
    try:
        array = np.asarray(fields[name], dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    wanted = (samples, columns)
    if array.size != samples * columns or len(array) != samples or samples < MIN_SAMPLES:
        raise RecordingError(f"{path}: {name} has shape {array.shape}; it must be {wanted}, numbers, and not empty.")
    require_possible(f"{path}, {name}", array, _MAX_VALUES[name])
    return array.reshape(wanted)


def _rate(path: Path, fields: Mapping[str, Any]) -> float:
    try:
        rate_hz = float(np.asarray(fields.get("sampling_rate"), dtype=np.float64).item())
    except (TypeError, ValueError):
        rate_hz = float("nan")
    if not 0 < rate_hz < np.inf:
        raise RecordingError(f"{path}: sampling_rate is {fields.get('sampling_rate')}; it must be a positive number.")
    return rate_hz


ENDINGS = (".hdf5", ".mat")
STILL_MARGIN_S = 1.0
"""How long before the marked movement the first rest is taken to end: the hand is at the sensor already."""

_NOTES = (
    "There is no position and no heading: the tilt alone is estimated, and yaw is not scored.",
    "Rows count where the trial is marked as movement and the optical attitude is known.",
)


@register("dataset", "broad")
@dataclass(frozen=True)
class Broad(FromFiles):
    """A trial of BROAD: tilt alone, a hand-held IMU against optical motion capture.

    The IMU lies still for half a minute, is then moved by hand, and lies still again; 285.7 Hz. The filter
    ``attitude_only`` evaluates an attitude filter on it, `inclination` measures its error::

        jerkbench run -m dataset=broad dataset.trial=7,16 attitude=real,gyro_only filter=attitude_only

    The sensor's axes are taken as the body's. The reference's yaw is left out (NaN): the recording holds no heading
    (the magnetometer is not read), so no filter could know it.

    Source: D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation
    Estimation", Data 6(7), 2021, doi:10.3390/data6070072; github.com/dlaidig/broad (CC BY 4.0).

    Attributes:
        folder: where the files of the trials are; empty: where `jerkbench data fetch broad` has put them.
        trial: number of the trial: the file whose name begins with it is read (.hdf5 or .mat).
        remove_gyro_bias: subtract the gyro's mean over the first rest.
    """

    attitude_only: ClassVar[bool] = True

    folder: str = ""
    trial: int = 16
    remove_gyro_bias: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the trial; ``seed`` changes nothing.

        Raises:
            RecordingError: the file is missing or damaged, or it does not begin with a rest and the gyro's bias is
                asked for.
        """
        (path,) = self.paths()
        trial = read_broad_trial(path)
        t_s = np.arange(len(trial.movement)) / trial.rate_hz
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def paths(self) -> tuple[Path, ...]:
        """Return the file of the trial."""
        folder = recording_folder(self.folder, "broad")
        if not folder.is_dir():
            raise RecordingError(f"There is no folder {folder}; give the one that the trials were copied to.")
        trials = sorted(path for path in folder.iterdir() if path.suffix in ENDINGS and path.is_file())
        named = [path for path in trials if path.name.startswith(f"{self.trial:02d}_")]
        if len(named) == 1:
            return (named[0],)
        names = ", ".join(path.name for path in (named or trials)) or "no .hdf5 or .mat file"
        raise RecordingError(
            f"{folder} has {len(named)} files of trial {self.trial} (a name that begins with '{self.trial:02d}_');"
            f" there: {names}."
        )


def recording_of(name: str, t_s: FloatArray, trial: BroadTrial, *, remove_gyro_bias: bool) -> Recording:
    """Return the recording of a trial: a hand-held IMU beside motion capture, with stamps ``t_s`` (n,)."""
    first = int(np.argmax(trial.movement)) if trial.movement.any() else len(trial.movement)
    rest_s = max(first / trial.rate_hz - STILL_MARGIN_S, 0.0)
    imu = Imu(t_s, trial.accel_mps2, trial.gyro_radps)
    return Recording(
        name=name,
        imu=without_gyro_bias(imu, rest_s) if remove_gyro_bias else imu,
        reference=_reference(name, t_s, trial),
        static_start_s=rest_s,
        notes=_NOTES,
    )


def _reference(name: str, t_s: FloatArray, trial: BroadTrial) -> Reference:
    known = unit_quaternions(trial.quaternion_wxyz)
    if not known.any():
        raise RecordingError(f"{name} has no optical attitude: no quaternion has the length 1; copy it again.")
    euler_rad = np.full((len(t_s), 3), np.nan)
    euler_rad[known, :2] = euler_from_quaternion(trial.quaternion_wxyz[known])[:, :2]
    scored, source = trial.movement & known, "optical motion capture"
    return Reference(t_s, source, independent=True, euler_rad=euler_rad, scored=scored)


# RepoIMU's TStick: a hand-held stick with an IMU beside optical motion capture, as Parquet.

RATE_HZ = 100.0
SATURATED_RADPS = 7.3
"""The gyro shows no more."""

WINDOW_S, SOUND = 10.0, 0.05
"""Over so long the mean specific force is gravity, but for such a share."""

_ACCEL, _GYRO, _ATTITUDE = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["qw", "qx", "qy", "qz"]


@register("dataset", "repoimu")
@dataclass(frozen=True)
class RepoImu(FromFiles):
    """A trial of RepoIMU's TStick: tilt alone, a stick in a hand against optical motion capture, 100 Hz.

    The stick lies still for two to four seconds and is then swung by hand for a minute and a half. As published, the
    reference shows a body that is turned by 2.8 degrees to the IMU, in a frame that is tilted by 1.7 degrees: every
    filter then has the same error. Both are constant, and need no filter to be found::

        B = the rotation with the least sum of |w_k - B y_G,k|^2,  w_k the rate that the reference shows
        T u = e3,  u = mean of q_k B y_A,k, normalised;   reference = T q_k B

    After marks were lost (Test05) the reference is wrong for up to a minute. A sample counts where the mean of q_k y_A
    over ten seconds around it has the length of gravity, within 5 %: no hand accelerates for that long. In Test05 the
    gyro saturates as well, at 7.36 rad/s.

    Each trial is a Parquet file ``TStick_Test02_Trial1.parquet`` with the columns t_s; ax, ay, az [m/s2]; gx, gy, gz
    [rad/s], in the sensor's axes; qw, qx, qy, qz, sensor to a frame whose z is up; movement (1: scored). No licence of
    the original is stated, so that it cannot be fetched: export the published CSV to these columns.

    Source: A. Szczesna and others, Annals of Computer Science and Information Systems 8, 2016;
    github.com/agnieszkaszczesna/RepoIMU.

    Attributes:
        folder: where the files of the trials are.
        test: number of the test.
        trial: number of the trial within it.
        remove_gyro_bias: subtract the gyro's mean over the first rest.
        align_reference: turn the reference by T and B, and score it where it is sound; otherwise as published.
    """

    attitude_only: ClassVar[bool] = True

    folder: str = ""
    test: int = 2
    trial: int = 1
    remove_gyro_bias: bool = True
    align_reference: bool = True

    def load(self, seed: int = 0) -> Recording:
        """Return the trial; ``seed`` changes nothing.

        Raises:
            RecordingError: the file is missing or damaged, or lacks a column.
        """
        (path,) = self.paths()
        columns = read_columns((path,), TextFormat())
        if len(columns) < MIN_SAMPLES:
            raise RecordingError(f"{path} has {len(columns)} rows; a trial has at least {MIN_SAMPLES}.")
        accel, gyro, attitude = map(columns.numbers, (_ACCEL, _GYRO, _ATTITUDE))
        t_s, movement = columns.numbers(["t_s", "movement"]).T
        t_s, trial = t_s - t_s[0], BroadTrial(RATE_HZ, accel, gyro, attitude, movement > 0)
        if self.align_reference:
            without_bias = recording_of(path.stem, t_s, trial, remove_gyro_bias=True).inertial
            trial = aligned(trial, without_bias)
        return recording_of(path.stem, t_s, trial, remove_gyro_bias=self.remove_gyro_bias)

    def paths(self) -> tuple[Path, ...]:
        """Return the file of the trial."""
        return (named_folder(self.folder) / f"TStick_Test{self.test:02d}_Trial{self.trial}.parquet",)


def aligned(trial: BroadTrial, imu: Imu) -> BroadTrial:
    """Return the trial with its reference in the axes of the IMU, upright, scored where it agrees with gravity."""
    from scipy.ndimage import uniform_filter1d

    known = unit_quaternions(trial.quaternion_wxyz)
    q = Rotation.from_quat(np.where(known[:, None], trial.quaternion_wxyz, [1.0, 0.0, 0.0, 0.0]), scalar_first=True)
    accel, gyro = imu.accel_mps2.copy(), imu.gyro_radps[1:]
    mean = uniform_filter1d(q.apply(accel), round(WINDOW_S * RATE_HZ), axis=0, mode="nearest")
    sound = known & (np.abs(np.linalg.norm(mean, axis=1) / GRAVITY_MPS2 - 1) < SOUND)
    rate: FloatArray = (q[:-1].inv() * q[1:]).as_rotvec() * RATE_HZ
    use = sound[1:] & sound[:-1] & (np.abs(gyro).max(axis=1) < SATURATED_RADPS)
    if not use.any():
        raise RecordingError("The reference nowhere agrees with gravity: it cannot be aligned; align_reference=false.")
    turned = q * Rotation.from_matrix(best_rotation(rate[use], gyro[use]))
    up = turned.apply(accel)[sound].mean(axis=0)
    upright = Rotation.from_matrix(dcm_from_euler(np.array([*roll_pitch(up), 0.0])))
    reference = np.where(known[:, None], (upright * turned).as_quat(scalar_first=True), np.nan)
    return trial._replace(quaternion_wxyz=reference, movement=trial.movement & sound)
