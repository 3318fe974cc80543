"""Readers of estimated trajectories, from columns of a file or the odometry of a bag, and interpolation."""

import glob
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows, require_choices, require_lengths, require_not_negative
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.io.bag import ODOMETRY, POSE, POSE_COVARIANCE, Messages, open_bag
from jerkbench.io.bag_writing import SOMETIME
from jerkbench.io.columns import TIME_UNITS, Columns, TextFormat, times_ns
from jerkbench.io.conversions import (
    ANGLE_UNITS,
    FRAMES,
    GPS_EPOCH_NS,
    GPST_MINUS_UTC_S,
    LOCAL_FRAMES,
    WEEK_NS,
    axes_in_enu,
    covariance_in_enu,
    in_degrees,
    in_enu,
    ns_since_1970,
)
from jerkbench.io.readers import read_columns
from jerkbench.io.sanitiser import OFF_EARTH, off_earth, require_fractions
from jerkbench.io.table import read_attitude
from jerkbench.io.writing import POSITIONS, VELOCITIES
from jerkbench.recording import Recording

_SAME_S = 1e-6
"""Maximum difference of equal stamps. As 64-bit numbers, seconds since 1970 have a resolution of a quarter of this."""


class Trajectory(NamedTuple):
    """An estimated trajectory.

    Attributes:
        where: name of the file for messages.
        t_s: (n,) increasing times since the start of the recording [s].
        enu_m: (n, 3) finite positions in ENU [m].
        velocity_mps: (n, 3) finite velocities in ENU [m/s], or None.
        euler_rad: (n, 3) roll, pitch, yaw [rad], with NaN in rows without an attitude, or None.
        covariance: (n, 6, 6) covariance of position and velocity in ENU, with NaN for unknown elements, or None.
    """

    where: str
    t_s: FloatArray
    enu_m: FloatArray
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    covariance: FloatArray | None = None


def estimate_at_reference(trajectory: Trajectory, recording: Recording, max_gap_s: float) -> Estimate:
    """Interpolate a trajectory at the stamps of the reference that the trajectory covers, without alignment.

    Position, velocity and covariance are interpolated linearly, and the attitude along the shortest rotation. If the
    trajectory ends more than ``max_gap_s`` seconds before the reference, the attribute ``failure`` of the estimate is a
    message about the early end.

    Raises:
        RecordingError: a stamp of the reference is between two samples whose interval is longer than ``max_gap_s``.
    """
    t_s, stamps_s = trajectory.t_s, recording.reference.t_s
    nearest_s = t_s[nearest_rows(t_s, stamps_s)]
    stamps_s = np.where(np.abs(stamps_s - nearest_s) <= _SAME_S, nearest_s, stamps_s)
    index = np.flatnonzero((stamps_s >= t_s[0]) & (stamps_s <= t_s[-1])).astype(np.int64)
    stamps_s = stamps_s[index]
    _require_near(trajectory, stamps_s, max_gap_s)
    failure, last_s, end_s = "", float(t_s[-1]), float(recording.reference.t_s[-1:].max(initial=-np.inf))
    if end_s > last_s + max_gap_s:
        failure = f"The trajectory ends at {last_s:.2f} s, but the reference ends at {end_s:.2f} s."

    def at_stamps(values: FloatArray | None, *shape: int) -> FloatArray:
        if values is None:
            return np.full((len(index), *shape), np.nan)
        columns = values.reshape(len(t_s), -1).T
        return np.column_stack([np.interp(stamps_s, t_s, column) for column in columns]).reshape(-1, *shape)

    return Estimate(
        index=index,
        position_m=at_stamps(trajectory.enu_m, 3),
        velocity_mps=at_stamps(trajectory.velocity_mps, 3),
        covariance=at_stamps(trajectory.covariance, 6, 6),
        euler_rad=_interpolated_angles(t_s, trajectory.euler_rad, stamps_s),
        failure=failure,
        position_only=trajectory.velocity_mps is None,
    )


def _require_near(trajectory: Trajectory, stamps_s: FloatArray, gap_s: float) -> None:
    """Check that no stamp is between two samples whose interval is longer than ``gap_s``.

    Raises:
        RecordingError: a stamp is between two samples with a longer interval.
    """
    t_s = trajectory.t_s
    after = np.searchsorted(t_s, stamps_s)
    wide = (t_s[after] > stamps_s) & (t_s[after] - t_s[after - 1] > gap_s + _SAME_S)
    if wide.any():
        k = int(np.argmax(wide))
        raise RecordingError(
            f"{trajectory.where} has no estimate between {t_s[after[k] - 1]:.2f} and {t_s[after[k]]:.2f} s, but the"
            f" reference has a stamp at {stamps_s[k]:.2f} s. There are {int(wide.sum())} such stamps and {len(t_s)}"
            f" estimates in total. Write an estimate at each stamp, or increase filter.max_gap_s (now {gap_s:g} s)."
        )


def _interpolated_angles(t_s: FloatArray, euler_rad: FloatArray | None, stamps_s: FloatArray) -> FloatArray:
    """Interpolate angles along the shortest rotation (k, 3), with NaN between samples of which one is unknown."""
    from scipy.spatial.transform import Rotation, Slerp

    angles_rad = np.full((len(stamps_s), 3), np.nan)
    if euler_rad is None:
        return angles_rad
    known = np.isfinite(euler_rad).all(axis=1)
    rows = np.isfinite(np.interp(stamps_s, t_s, np.where(known, 0.0, np.nan)))
    if known.sum() > 1:
        turn = Slerp(t_s[known], Rotation.from_matrix(dcm_from_euler(euler_rad[known])))
        angles_rad[rows] = euler_from_dcm(turn(stamps_s[rows]).as_matrix())
    return angles_rad


# A trajectory that a ROS node has published, from a topic of a bag.

_BAGS = (".bag", ".db3", ".mcap")
"""Endings of bags."""

_POSE = ("position", "orientation")
_FIELDS = {
    ODOMETRY: (*_POSE, "linear", "position_covariance", "linear_covariance"),
    POSE_COVARIANCE: (*_POSE, "position_covariance"),
    POSE: _POSE,
}
"""Fields that are read from each type."""


def read_odometry(path: Path, topic: str, recording: Recording) -> Trajectory:
    """Read a trajectory from a topic of a bag. Poses must be in the ENU frame of the recording, twists in body axes.

    Args:
        path: path of the bag.
        topic: name of the topic, or empty for the only odometry of the bag.
        recording: the recording that the ROS node has processed. If the recording has no date, its start is assumed to
            be 1 January 2020, because a bag that jerkbench exports then starts on this date.

    Raises:
        RecordingError: the topic does not exist, has no poses, or has stamps that do not increase.
    """
    with open_bag(path) as bag:
        odometries = [topic.name for topic in bag.topics if topic.msgtype == ODOMETRY]
        if not topic and len(odometries) != 1:
            raise RecordingError(
                f"{path} has {len(odometries)} topics of the type {ODOMETRY} ({', '.join(odometries) or 'none'});"
                " select one topic with filter.topic=NAME."
            )
        name = topic or odometries[0]
        msgtype = bag.topic(name).msgtype
        if msgtype not in _FIELDS:
            raise RecordingError(
                f"{path}: {name} has the type {msgtype}; select a topic of Odometry or poses with filter.topic=NAME."
            )
        messages = bag.read({name: _FIELDS[msgtype]})[name]
    if count := int((np.diff(messages.stamp_ns) <= 0).sum()):
        raise RecordingError(
            f"{path}, {name}: {count} of {len(messages)} stamps do not increase; publish each stamp once and in order."
        )
    t_s = np.asarray((messages.stamp_ns - ns_since_1970(recording.start_utc or SOMETIME)) * 1e-9)
    dcm = dcm_from_quaternion(messages["orientation"])
    velocity = np.einsum("nij,nj->ni", dcm, messages["linear"]) if msgtype == ODOMETRY else None
    covariance = _odometry_covariance(messages, dcm)
    return Trajectory(f"{path}, {name}", t_s, messages["position"], velocity, euler_from_dcm(dcm), covariance)


def _odometry_covariance(messages: Messages, dcm: FloatArray) -> FloatArray | None:
    """Return covariances (n, 6, 6) in ENU, or None if all position covariances are zero.

    The cross-covariances of position and velocity are zero. If all velocity covariances in the messages are zero, the
    velocity covariance is unknown, and all elements except the position covariances are NaN.
    """
    position, linear = (messages.values.get(f"{part}_covariance", np.zeros(1)) for part in ("position", "linear"))
    if not position.any():
        return None
    covariance = np.full((len(messages), 6, 6), np.nan)
    covariance[:, :3, :3] = position.reshape(-1, 3, 3)
    if linear.any():
        covariance[:, :3, 3:] = covariance[:, 3:, :3] = 0.0
        covariance[:, 3:, 3:] = dcm @ linear.reshape(-1, 3, 3) @ np.swapaxes(dcm, 1, 2)
    return covariance


# The format of a file with a trajectory: the columns, their frames and units, and the clock.

_CLOCKS = ("", "start", "unix")
_CHOICES = {
    "time_unit": tuple(TIME_UNITS),
    "clock": _CLOCKS,
    "frame": FRAMES,
    "angle_unit": tuple(ANGLE_UNITS),
    "attitude_unit": tuple(ANGLE_UNITS),
    "attitude_frame": ("", "enu", "ned"),
    "body": ("flu", "frd"),
}
_COUNTS = {"position": (0, 3), "velocity": (0, 3), "attitude": (0, 3, 4), "covariance": (0, 3, 6, 21, 36)}
"""Allowed numbers of columns of each parameter."""

TEXT: dict[str, Any] = {"separator": "", "header": False, "time_unit": "s", "covariance": ()}
TUM = TEXT | {"comment": "#", "time": "1", "time_week": "", "position": tuple("234"), "velocity": ()}
TUM |= {"attitude": tuple("8567")}
"""A line is ``t x y z qx qy qz qw``; the user chooses the frame."""

KF_GINS = TEXT | {"time_week": "1", "time": "2", "position": tuple("345"), "velocity": tuple("678")}
KF_GINS |= {"frame": "geodetic", "angle_unit": "deg", "attitude_frame": "ned", "body": "frd"}
KF_GINS |= {"attitude": ("9", "10", "11"), "attitude_unit": "deg"}
"""A line is ``week second latitude longitude height vn ve vd roll pitch yaw``."""

_KNOWN: dict[str, dict[str, Any]] = {".tum": TUM, ".nav": KF_GINS}
"""Endings of files with known columns."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryForm:
    """The columns of a trajectory, by the names in the header or by numbers from 1.

    For a file that ends in .tum (``t x y z qx qy qz qw``) or .nav (KF-GINS), the columns are known. In any other table
    (CSV, Parquet, .mat), the default columns have the names of an exported recording. The required columns are t_s and
    the position: east_m, north_m, up_m (ENU), north_m, east_m, down_m (NED), or latitude_deg, longitude_deg, height_m
    (geodetic). Optional columns are east_mps, north_mps, up_mps (for NED and geodetic positions: north_mps, east_mps,
    down_mps), roll_rad, pitch_rad, yaw_rad, and P11, P12, ..., P16, P22, ..., P66.

    Attributes:
        time: column of the times.
        time_unit: unit of the times: s, ms, us or ns.
        time_week: column with the GPS week, or empty if the times do not restart each week.
        clock: epoch of the times: start (of the recording) or unix (1970, UTC). If ``clock`` is empty, the epoch is
            unix if the first time is larger than 100 000 000 s, otherwise start.
        position: names of three columns of positions, in the order of the axes of ``frame``.
        frame: frame of position, covariance and velocity: enu, ned, geodetic or ecef. With geodetic positions,
            velocity, covariance and attitude are in NED. The frame ecef is only for positions.
        angle_unit: unit of latitude and longitude: deg or rad.
        velocity: names of three columns of velocities [m/s].
        attitude: names of three columns (roll, pitch, yaw) or four columns (w, x, y, z) of the rotation from the body
            to the local frame.
        attitude_unit: unit of roll, pitch and yaw: rad or deg.
        attitude_frame: local frame of the attitude: enu or ned, or empty for the frame of the velocity.
        body: axes that the attitude describes: flu or frd.
        covariance: names of the columns with three variances (position), six variances (position and velocity), or 21
            (11, 12, ..., 16, 22, ..., 66) or 36 elements of the covariance matrix, row by row.
        separator: separator of the columns of a text file, or empty for white space.
        header: whether a line above the data names the columns.
        comment: characters at the start of the lines that are ignored, or empty to ignore no lines.
        topic: topic of a ROS bag with Odometry or poses, or empty for the only Odometry of the bag. Poses must be in
            the ENU frame of the recording, with body axes forward, left and up. Twists must be in body axes. The
            parameters from ``time`` to ``comment`` have no effect for a bag.
        max_gap_s: maximum interval between two samples that is interpolated [s].
    """

    time: str = "t_s"
    time_unit: str = "s"
    time_week: str = ""
    clock: str = ""
    position: tuple[str, ...] = ()
    frame: str = "enu"
    angle_unit: str = "deg"
    velocity: tuple[str, ...] = ()
    attitude: tuple[str, ...] = ()
    attitude_unit: str = "rad"
    attitude_frame: str = ""
    body: str = "flu"
    covariance: tuple[str, ...] = ()
    separator: str = ","
    header: bool = True
    comment: str = ""
    topic: str = ""
    max_gap_s: float = 0.2

    def __post_init__(self) -> None:
        require_choices(self, _CHOICES)
        require_lengths(self, _COUNTS)
        require_not_negative("trajectory", self, ("max_gap_s",))

    @property
    def local_frame(self) -> str:
        """The frame of the velocity and the covariance, which is NED for geodetic positions."""
        return "ned" if self.frame == "geodetic" else self.frame


_PLACES = POSITIONS | {"ecef": ("x_m", "y_m", "z_m")}
_ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
_UPPER = [(i, j) for i in range(6) for j in range(i, 6)]
COVARIANCE = tuple(f"P{i + 1}{j + 1}" for i, j in _UPPER)
"""Default names of the columns of the covariance."""

LATER_THAN_NS = 100_000_000 * 1_000_000_000
"""Larger stamps are regarded as times since 1970, because no recording lasts three years."""

STILL = np.array([0.0, 0.0, 0.0])


def read_trajectory(path: Path, declared: TrajectoryForm, recording: Recording) -> Trajectory:
    """Read an estimated trajectory from a file.

    Args:
        path: path of a .tum, .nav, .csv, .parquet or .mat file, of a ROS bag (.bag, .db3, .mcap), or of any text file
            with columns.
        declared: the format of the file, if the ending of its name does not define the format.
        recording: the recording that defines time 0 and the ENU frame of the result.

    Raises:
        RecordingError: the file or a column does not exist, a cell is not a finite number, times do not increase, or
            the recording lacks the start or the origin that the conversion of times or positions needs.
    """
    if not path.is_file():
        raise RecordingError(f"The trajectory {path} does not exist; correct the path.")
    if path.suffix in _BAGS:
        return read_odometry(path, declared.topic, recording)
    base = TrajectoryForm(**{f.name: getattr(declared, f.name) for f in fields(TrajectoryForm)})
    form = replace(base, **_KNOWN.get(path.suffix, {}))
    columns = read_columns([path], TextFormat(form.separator, form.header, form.comment))
    t_s = _seconds(columns, form, recording)
    enu_m = _places(columns, form, recording)
    velocity = _velocity(columns, form)
    return Trajectory(str(path), t_s, enu_m, velocity, _attitude(path, columns, form), _covariance(columns, form, t_s))


def _seconds(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    t_ns = times_ns(columns, form.time, form.time_unit, form.time_week)
    require_fractions(columns.where, t_ns, np.full(len(t_ns), fill_value=True))
    columns.stamped(t_ns).require_increasing()
    if form.clock == "start" or not (form.clock or form.time_week or t_ns[0] > LATER_THAN_NS):
        return np.asarray(t_ns * 1e-9)
    if recording.start_utc is None:
        raise RecordingError(
            f"{columns.where} has absolute stamps, but {recording.name} has no date; write seconds since the start of"
            " the recording (filter.clock=start)."
        )
    zero_ns = ns_since_1970(recording.start_utc)
    if form.time_week:
        zero_ns += round(GPST_MINUS_UTC_S * 1e9) - GPS_EPOCH_NS
        if t_ns[0] < WEEK_NS:  # KF-GINS writes week 0 for an unknown week
            zero_ns %= WEEK_NS
    return np.asarray((t_ns - zero_ns) * 1e-9)


def _places(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    if form.frame not in LOCAL_FRAMES and recording.origin is None:
        raise RecordingError(
            f"{columns.where} has the frame {form.frame}, but {recording.name} has no origin; write local coordinates"
            " (filter.frame=enu or filter.frame=ned)."
        )
    places = in_degrees(columns.finite(form.position or _PLACES[form.frame]), form.frame, form.angle_unit)
    for row in np.flatnonzero(off_earth(places, form.frame)):
        raise RecordingError(f"{columns.where}, row {row + 1} has {OFF_EARTH}; correct the row, the frame or the unit.")
    return in_enu(places, form.frame, recording.origin)


def _velocity(columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    names = form.velocity or _there(columns, VELOCITIES.get(form.local_frame, ()))
    if not names:
        return None
    if form.frame == "ecef":
        raise RecordingError(
            f"{columns.where} has velocities in ECEF, but frame=ecef supports only positions; use enu, ned or geodetic."
        )
    return axes_in_enu(columns.finite(names), form.local_frame)


def _attitude(path: Path, columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    angles = form.attitude or _there(columns, _ATTITUDE)
    frame = form.attitude_frame or ("ned" if form.local_frame == "ned" else "enu")
    unit = form.attitude_unit if form.attitude else "rad"
    euler_rad = read_attitude(columns, angles, unit, frame, form.body)
    unknown = path.suffix == ".tum" and euler_rad is not None and bool((np.nan_to_num(euler_rad) == STILL).all())
    return None if unknown else euler_rad  # in TUM files, the identity means "unknown"


def _covariance(columns: Columns, form: TrajectoryForm, t_s: FloatArray) -> FloatArray | None:
    """Return covariances (n, 6, 6) in ENU, with NaN for elements that the table does not contain."""
    names = form.covariance or _there(columns, COVARIANCE)
    if not names:
        return None
    values, n = columns.finite(names), len(t_s)
    covariance = np.full((n, 6, 6), np.nan)
    if len(names) == 36:
        covariance = values.reshape(n, 6, 6)
    elif len(names) == 21:
        i, j = np.array(_UPPER).T
        covariance[:, i, j] = covariance[:, j, i] = values
    else:
        states = slice(0, len(names))
        covariance[:, states, states] = values[:, :, None] * np.eye(len(names))
    return covariance_in_enu(covariance, form.local_frame)


def _there(columns: Columns, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return ``names`` if the table has all these columns, otherwise an empty tuple."""
    return names if columns.has(names) else ()


# Patterns of files with one file for each seed. A pattern contains ``{seed}`` instead of the number.

SEED = "{seed}"


def path_of_seed(pattern: str, seed: int) -> Path:
    """Return the path of the file of one seed."""
    return Path(pattern.replace(SEED, str(seed))).expanduser()


def seeds_of(pattern: str) -> dict[int, Path]:
    """Return the existing files by seed, sorted, or an empty dictionary if the pattern does not contain ``{seed}``."""
    pattern = str(Path(pattern).expanduser())
    first, *others = map(re.escape, pattern.split(SEED))
    expression = re.compile(first + r"(\d+)" + r"\1".join(others) if others else "(?!)")
    matches = (expression.fullmatch(path) for path in glob.glob(glob.escape(pattern).replace(SEED, "*")))  # noqa: PTH207 - the folder may have a seed too
    return dict(sorted((int(match[1]), Path(match[0])) for match in matches if match))


def files_digest(pattern: str) -> str:
    """Return one SHA-256 hash of all seeds and the contents of their files.

    Raises:
        RecordingError: a file does not exist.
    """
    paths = seeds_of(pattern) if SEED in pattern else {0: Path(pattern).expanduser()}
    if not paths or not all(path.is_file() for path in paths.values()):
        raise RecordingError(f"The trajectory {pattern} does not exist; correct the path.")
    sha = hashlib.sha256()
    for seed, path in paths.items():
        sha.update(f"{seed} {len(content := path.read_bytes())} ".encode() + content)
    return sha.hexdigest()


def pattern_of(names: Sequence[str]) -> str:
    """Return the pattern of file names that differ in one number, for example ``run_{seed}.tum`` for ``run_0.tum``.

    Raises:
        RecordingError: the names differ in more than one number, or the pattern would not give these names, for example
            because of leading zeros.
    """
    if len(set(names)) == 1:
        return names[0]
    parts = [re.split(r"(\d+)", name) for name in names]
    if len({len(split) for split in parts}) == 1:
        differing = [k for k, column in enumerate(zip(*parts, strict=True)) if len(set(column)) > 1]
        pattern = "".join(SEED if k in differing else part for k, part in enumerate(parts[0]))
        # names with leading zeros fail the comparison of the pattern with the names
        numbers = [split[differing[0]] for split in parts if split[differing[0]].isdigit()]
        if pattern.count(SEED) == 1 and {pattern.replace(SEED, str(int(n))) for n in numbers} == set(names):
            return pattern
    raise RecordingError(
        f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}: the names of files of several seeds must differ in"
        " one number, the seed. Rename the files, or give a pattern with {seed} instead of the number."
    )
