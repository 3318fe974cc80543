"""An estimated trajectory, of a file's columns or a bag's odometry, in ENU on the recording's clock."""

import glob
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray, require_choices, require_lengths, require_not_negative
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.io.bag import ODOMETRY, Bag, Messages, open_bag
from jerkbench.io.bag_writing import SOMETIME
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS, ns_since_1970
from jerkbench.io.columns import TIME_UNITS, Columns, read_columns, times_ns
from jerkbench.io.frames import ANGLE_UNITS, FRAMES, LOCAL_FRAMES, axes_in_enu, covariance_in_enu, in_degrees, in_enu
from jerkbench.io.sanitiser import OFF_EARTH, off_earth
from jerkbench.io.table import AttitudeMap, read_attitude
from jerkbench.io.text import TextFormat
from jerkbench.io.writing import POSITIONS, VELOCITIES
from jerkbench.recording import Recording

_SAME_S = 1e-6
"""Stamps that are nearer are the same: seconds since 1970 in 64 bits are known to a quarter of that."""


class Trajectory(NamedTuple):
    """Estimates at stamps of their own.

    Attributes:
        where: the file, for errors.
        t_s: (n,) seconds from the recording's start; increasing.
        enu_m: (n, 3) finite.
        velocity_mps: (n, 3) in ENU, finite, or None.
        euler_rad: (n, 3) roll, pitch, yaw; NaN where unknown; or None.
        covariance: (n, 6, 6) of position and velocity in ENU, NaN where unknown; or None.
    """

    where: str
    t_s: FloatArray
    enu_m: FloatArray
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    covariance: FloatArray | None = None


def estimate_at_reference(trajectory: Trajectory, recording: Recording, max_gap_s: float) -> Estimate:
    """Return the estimate at the reference's stamps from the trajectory's first sample to its last; nothing is aligned.

    A stamp between two samples that are no more than ``max_gap_s`` [s] apart is interpolated between them: position,
    velocity and covariance on a straight line, the attitude by the shortest turn. A trajectory that ends earlier than
    the reference, by more than that, is a run that stopped.

    Raises:
        RecordingError: it leaves a stamp in a longer gap.
    """
    stamps_s = recording.reference.t_s
    begin, end = trajectory.t_s[[0, -1]] + [-_SAME_S, _SAME_S]
    index = np.flatnonzero((stamps_s >= begin) & (stamps_s <= end)).astype(np.int64)
    before, share = _between(trajectory, stamps_s[index], max_gap_s)
    absent, failure, last_s = np.full((len(index), 3), np.nan), "", float(trajectory.t_s[-1])
    if len(stamps_s) and stamps_s[-1] > last_s + max_gap_s:
        failure = f"The trajectory ends at {last_s:.2f} s, the reference at {stamps_s[-1]:.2f} s."
    velocity, covariance, euler = trajectory.velocity_mps, trajectory.covariance, trajectory.euler_rad
    return Estimate(
        index=index,
        position_m=_on_line(trajectory.enu_m, before, share),
        velocity_mps=absent if velocity is None else _on_line(velocity, before, share),
        covariance=np.full((len(index), 6, 6), np.nan) if covariance is None else _on_line(covariance, before, share),
        euler_rad=absent if euler is None else _turned(euler, before, share),
        failure=failure,
        position_only=velocity is None,
    )


def _between(trajectory: Trajectory, stamps_s: FloatArray, gap_s: float) -> tuple[IntArray, FloatArray]:
    """Return (k,) the sample before each stamp, and how far (0 to 1) it is to the next; a sample at the stamp is taken.

    Raises:
        RecordingError: the samples around a stamp are further apart than ``gap_s``.
    """
    t_s, last = trajectory.t_s, len(trajectory.t_s) - 1
    before = np.clip(np.searchsorted(t_s, stamps_s + _SAME_S, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    since_s, length_s = stamps_s - t_s[before], t_s[after] - t_s[before]
    between = np.abs(since_s) > _SAME_S
    wide = between & (length_s > gap_s + _SAME_S)
    if wide.any():
        k = int(np.argmax(wide))
        raise RecordingError(
            f"{trajectory.where} has no estimate between {t_s[before[k]]:.2f} and {t_s[after[k]]:.2f} s, where the"
            f" reference has one at {stamps_s[k]:.2f} s ({int(wide.sum())} such stamps, {last + 1} estimates in all);"
            f" write an estimate at each stamp, or allow longer gaps than {gap_s:g} s (filter.max_gap_s)."
        )
    return before.astype(np.int64), np.where(between, since_s / np.where(length_s > 0, length_s, 1.0), 0.0)


def _on_line(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """(k, ...) values on the straight line from the sample before to the one after; at a sample its own, to the bit."""
    after = np.minimum(before + 1, len(values) - 1)
    weight = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.where(weight == 0.0, values[before], (1.0 - weight) * values[before] + weight * values[after])


def _turned(euler_rad: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """(k, 3) angles on the shortest turn from the sample before to the one after; NaN where one of them is unknown."""
    from scipy.spatial.transform import Rotation

    turned, second_rad = euler_rad[before], euler_rad[np.minimum(before + 1, len(euler_rad) - 1)]
    turned[(share > 0) & ~np.isfinite(second_rad).all(axis=1)] = np.nan
    rows = np.flatnonzero((share > 0) & np.isfinite(turned).all(axis=1))
    if len(rows):
        first, second = (Rotation.from_matrix(dcm_from_euler(angles[rows])) for angles in (turned, second_rad))
        part = Rotation.from_rotvec((first.inv() * second).as_rotvec() * share[rows, None])
        turned[rows] = euler_from_dcm((first * part).as_matrix())
    return turned


# A topic of a ROS bag -> the trajectory that a node has published.

_BAGS = (".bag", ".db3", ".mcap")
"""Endings of bags."""

POSES = ("geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped")
_POSE = ("position", "orientation")
_FIELDS = {
    ODOMETRY: (*_POSE, "linear", "position_covariance", "linear_covariance"),
    POSES[0]: (*_POSE, "position_covariance"),
    POSES[1]: _POSE,
}
"""What is read of each type."""


def read_odometry(path: Path, topic: str, recording: Recording) -> Trajectory:
    """Read what a node has published: poses in the recording's ENU, the twist in the body, with their covariances.

    Args:
        path: the bag.
        topic: its name; empty: the only odometry of the bag.
        recording: what the node has run over; where nobody knows when it began, an exported bag begins in 2020.

    Raises:
        RecordingError: there is no such topic, it has no poses, or its stamps do not increase.
    """
    with open_bag(path) as bag:
        name = topic or _only_odometry(bag)
        msgtype = bag.topic(name).msgtype
        if msgtype not in _FIELDS:
            advice = "name a topic of Odometry or of poses: filter.topic=..."
            raise RecordingError(f"{path}: {name} is a {msgtype}; {advice}")
        messages = bag.read({name: _FIELDS[msgtype]})[name]
    where = f"{path}, {name}"
    t_s = _odometry_s(where, messages, recording)
    dcm = dcm_from_quaternion(messages["orientation"])
    velocity = np.einsum("nij,nj->ni", dcm, messages["linear"]) if msgtype == ODOMETRY else None
    return Trajectory(
        where, t_s, messages["position"], velocity, euler_from_dcm(dcm), _odometry_covariance(messages, dcm)
    )


def _only_odometry(bag: Bag) -> str:
    names = [topic.name for topic in bag.topics if topic.msgtype == ODOMETRY]
    if len(names) != 1:
        raise RecordingError(
            f"{bag.path} has {len(names)} topics of {ODOMETRY}{': ' if names else ''}{', '.join(names)}; name the one "
            "to score: filter.topic=..."
        )
    return names[0]


def _odometry_s(where: str, messages: Messages, recording: Recording) -> FloatArray:
    start_ns = ns_since_1970(recording.start_utc or SOMETIME)
    if count := int((np.diff(messages.stamp_ns) <= 0).sum()):
        raise RecordingError(
            f"{where}: {count} of {len(messages)} messages are not later than the one before; publish each stamp once."
        )
    return np.asarray((messages.stamp_ns - start_ns) * 1e-9)


def _odometry_covariance(messages: Messages, dcm: FloatArray) -> FloatArray | None:
    """(n, 6, 6) in ENU; between position and velocity a message has none: zero; all zeros mean that it has nothing."""
    position, linear = (messages.values.get(f"{part}_covariance", np.zeros(1)) for part in ("position", "linear"))
    if not position.any():
        return None
    covariance = np.full((len(messages), 6, 6), np.nan)
    covariance[:, :3, :3] = position.reshape(-1, 3, 3)
    if linear.any():
        covariance[:, :3, 3:] = covariance[:, 3:, :3] = 0.0
        covariance[:, 3:, 3:] = dcm @ linear.reshape(-1, 3, 3) @ np.swapaxes(dcm, 1, 2)
    return covariance


# The form of a trajectory's file: which columns are what, in which frame and unit, on which clock.

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
"""How many columns each parameter may name."""

TEXT: dict[str, Any] = {"separator": "", "header": False, "time_unit": "s", "covariance": ()}
TUM = TEXT | {"comment": "#", "time": "1", "time_week": "", "position": tuple("234"), "velocity": ()}
TUM |= {"attitude": tuple("8567")}
"""A line ``t x y z qx qy qz qw``; the frame is the user's."""

KF_GINS = TEXT | {"time_week": "1", "time": "2", "position": tuple("345"), "velocity": tuple("678")}
KF_GINS |= {"frame": "geodetic", "angle_unit": "deg", "attitude_frame": "ned", "body": "frd"}
KF_GINS |= {"attitude": ("9", "10", "11"), "attitude_unit": "deg"}
"""A line ``week second latitude longitude height vn ve vd roll pitch yaw``."""

_KNOWN: dict[str, dict[str, Any]] = {".tum": TUM, ".nav": KF_GINS}
"""Endings of files whose columns need no map."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryForm:
    """The columns of a trajectory, by the header's names or by numbers from 1.

    A file that ends in .tum (``t x y z qx qy qz qw``) or .nav (KF-GINS) needs no map. Of any other table (CSV, Parquet,
    .mat) the columns that are not named are looked for by the names that an exported recording has: t_s, east_m,
    north_m, up_m (by frame: north_m, east_m, down_m, or latitude_deg, longitude_deg, height_m), and, where they are
    there, east_mps, north_mps, up_mps (of NED, and of geodetic places: north_mps, east_mps, down_mps), roll_rad,
    pitch_rad, yaw_rad, and P11, P12, ..., P16, P22, ..., P66.

    Attributes:
        time: the column of times.
        time_unit: s, ms, us or ns.
        time_week: the column of GPS weeks, where the times are GPS seconds of the week; empty: they are not.
        clock: what times count from: start (of the recording), unix (1970, UTC); empty: unix where the first is beyond
            100 000 000 s.
        position: three columns, in the order of the frame.
        frame: of position and covariance, and of velocity: enu, ned, geodetic (velocity, covariance and attitude: NED)
            or ecef (position alone).
        angle_unit: of latitude and longitude: deg or rad.
        velocity: three columns.
        attitude: three columns (roll, pitch, yaw) or four (w, x, y, z), body to local frame.
        attitude_unit: of roll, pitch and yaw: rad or deg.
        attitude_frame: the local frame of the attitude: enu or ned; empty: that of the velocity.
        body: whose attitude it is: flu or frd.
        covariance: columns of variances: three (position) or six (and velocity); or of the whole matrix of both: 21
            (11, 12, ..., 16, 22, ..., 66) or 36, row by row.
        separator: between the columns of a text; empty: white space.
        header: whether a line names the columns.
        comment: what a line to be left out begins with.
        topic: of a ROS bag, the Odometry or poses to take; empty: its only Odometry. Poses are in the recording's ENU,
            the body is forward, left, up, the twist is in it, and nothing of the above is asked.
        max_gap_s: between two samples that are further apart nothing is interpolated.
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
        """Check every choice and every number of columns."""
        require_choices(self, _CHOICES)
        require_lengths(self, _COUNTS)
        require_not_negative("trajectory", self, ("max_gap_s",))

    @property
    def local_frame(self) -> str:
        """The axes of the velocity and the covariance."""
        return "ned" if self.frame == "geodetic" else self.frame


_PLACES = POSITIONS | {"ecef": ("x_m", "y_m", "z_m")}
_ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
_UPPER = [(i, j) for i in range(6) for j in range(i, 6)]
COVARIANCE = tuple(f"P{i + 1}{j + 1}" for i, j in _UPPER)
"""Names of columns that nobody has to give."""

LATER_THAN_NS = 100_000_000 * 1_000_000_000
"""Stamps beyond this count from 1970: no recording lasts three years."""

STILL = np.array([0.0, 0.0, 0.0])


def read_trajectory(path: Path, declared: TrajectoryForm, recording: Recording) -> Trajectory:
    """Read the trajectory in ``path``.

    Args:
        path: .tum, .nav, .csv, .parquet, .mat, a ROS bag (.bag, .db3, .mcap), or any text of columns.
        declared: the form of files that do not say it themselves.
        recording: on whose clock, and in whose ENU, it is read.

    Raises:
        RecordingError: there is no such file or column, a cell is no finite number, times do not increase, or clock or
            frame cannot be told.
    """
    if not path.is_file():
        raise RecordingError(f"There is no trajectory {path}; correct its name.")
    if path.suffix in _BAGS:
        return read_odometry(path, declared.topic, recording)
    own = TrajectoryForm(**{f.name: getattr(declared, f.name) for f in fields(TrajectoryForm)})
    form = replace(own, **_KNOWN.get(path.suffix, {}))
    columns = read_columns([path], TextFormat(form.separator, form.header, form.comment))
    if len(columns) == 0:
        raise RecordingError(f"{path} has no estimate in it; write one line for each stamp.")
    t_s = _seconds(columns, form, recording)
    enu_m = _places(columns, form, recording)
    velocity = _velocity(columns, form)
    return Trajectory(str(path), t_s, enu_m, velocity, _attitude(path, columns, form), _covariance(columns, form, t_s))


def _seconds(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    t_ns = times_ns(columns, form.time, form.time_unit, form.time_week) - _zero_ns(columns, form, recording)
    steps = np.diff(t_ns)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 2
        raise RecordingError(f"{columns.where}, row {row}: its time is not after that of the row above; sort the rows.")
    return np.asarray(t_ns * 1e-9)


def _zero_ns(columns: Columns, form: TrajectoryForm, recording: Recording) -> int:
    """The recording's start on the clock of the file."""
    first_ns = int(times_ns(columns, form.time, form.time_unit, form.time_week)[0])
    if form.clock == "start" or not (form.clock or form.time_week or first_ns > LATER_THAN_NS):
        return 0
    if recording.start_utc is None:
        raise RecordingError(
            f"{columns.where} has stamps of a calendar, and nobody knows when {recording.name} began; write seconds"
            " from its start (filter.clock=start)."
        )
    unix_ns = ns_since_1970(recording.start_utc)
    if not form.time_week:
        return unix_ns
    gps_ns = unix_ns - GPS_EPOCH_NS + round(GPST_MINUS_UTC_S * 1e9)
    return gps_ns if first_ns >= WEEK_NS else gps_ns % WEEK_NS  # week 0 is KF-GINS's for one that it does not know


def _places(columns: Columns, form: TrajectoryForm, recording: Recording) -> FloatArray:
    if form.frame not in LOCAL_FRAMES and recording.origin is None:
        raise RecordingError(
            f"{columns.where} is in the frame {form.frame}, and {recording.name} has no origin on the Earth; write its"
            " local axes (filter.frame=enu or ned)."
        )
    values = _finite(columns, form.position or _PLACES[form.frame], "position")
    places = in_degrees(values, form.frame, form.angle_unit)
    for row in np.flatnonzero(off_earth(places, form.frame)):
        raise RecordingError(f"{columns.where}, row {row + 1} has {OFF_EARTH}; correct it, or frame and unit.")
    return in_enu(places, form.frame, recording.origin)


def _velocity(columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    names = form.velocity or _there(columns, VELOCITIES.get(form.local_frame, ()))
    if not names:
        return None
    if form.frame == "ecef":
        raise RecordingError(
            f"{columns.where} is in ECEF, of which positions are read alone; write ENU, NED or geodetic."
        )
    return axes_in_enu(_finite(columns, names, "velocity"), form.local_frame)


def _attitude(path: Path, columns: Columns, form: TrajectoryForm) -> FloatArray | None:
    angles = form.attitude or _there(columns, _ATTITUDE)
    frame = form.attitude_frame or ("ned" if form.local_frame == "ned" else "enu")
    unit = form.attitude_unit if form.attitude else "rad"
    mapping = AttitudeMap(tuple(angles), unit, frame, form.body, ("x", "y", "z"))
    euler_rad = read_attitude(columns, mapping)
    nothing = path.suffix == ".tum" and euler_rad is not None and bool((np.nan_to_num(euler_rad) == STILL).all())
    return None if nothing else euler_rad  # TUM has no way to leave a rotation out: the identity stands for it


def _covariance(columns: Columns, form: TrajectoryForm, t_s: FloatArray) -> FloatArray | None:
    """(n, 6, 6) in ENU; what is not given of it is NaN."""
    names = form.covariance or _there(columns, COVARIANCE)
    if not names:
        return None
    values, n = _finite(columns, names, "covariance"), len(t_s)
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
    """Return ``names`` if the table has all of them, else none."""
    return names if columns.has(names) else ()


def _finite(columns: Columns, names: tuple[str, ...], quantity: str) -> FloatArray:
    values = columns.numbers(names)
    for row, place in np.argwhere(~np.isfinite(values)):
        raise RecordingError(
            f"{columns.where}, row {row + 1}: the {quantity} ({names[place]}) is no finite number; write one at each"
            " stamp, or end the file where the estimate ends."
        )
    return values


# Files of which each seed has one: a pattern with ``{seed}`` in the place of the number.

SEED = "{seed}"


def path_of_seed(pattern: str, seed: int) -> Path:
    """Return the file of one seed."""
    return Path(pattern.replace(SEED, str(seed))).expanduser()


def seeds_of(pattern: str) -> dict[int, Path]:
    """Return the files that there are by their seeds, in order; without ``{seed}`` there are none to tell apart."""
    pattern = str(Path(pattern).expanduser())
    first, *others = map(re.escape, pattern.split(SEED))
    expression = re.compile(first + r"(\d+)" + r"\1".join(others) if others else "(?!)")
    matches = (expression.fullmatch(path) for path in glob.glob(glob.escape(pattern).replace(SEED, "*")))  # noqa: PTH207 - the folder may have a seed too
    return dict(sorted((int(match[1]), Path(match[0])) for match in matches if match))


def files_digest(pattern: str) -> str:
    """Return the SHA-256 over the files of all seeds, and their seeds.

    Raises:
        RecordingError: there is no file.
    """
    paths = seeds_of(pattern) if SEED in pattern else {0: Path(pattern).expanduser()}
    if not paths or not all(path.is_file() for path in paths.values()):
        raise RecordingError(f"There is no trajectory {pattern}; correct its name.")
    sha = hashlib.sha256()
    for seed, path in paths.items():
        sha.update(f"{seed} {len(content := path.read_bytes())} ".encode() + content)
    return sha.hexdigest()


def pattern_of(names: Sequence[str]) -> str:
    """Return the pattern of files that one number tells apart: ``run_0.tum``, ``run_1.tum`` -> ``run_{seed}.tum``.

    Raises:
        RecordingError: something else tells them apart, or the pattern would mean other files.
    """
    if len(set(names)) == 1:
        return names[0]
    parts = [re.split(r"(\d+)", name) for name in names]
    if len({len(split) for split in parts}) == 1:
        places = [k for k, column in enumerate(zip(*parts, strict=True)) if len(set(column)) > 1]
        pattern = "".join(SEED if k in places else part for k, part in enumerate(parts[0]))
        numbers = [split[places[0]] for split in parts if split[places[0]].isdigit()]  # leading zeros would be lost
        if pattern.count(SEED) == 1 and {pattern.replace(SEED, str(int(n))) for n in numbers} == set(names):
            return pattern
    raise RecordingError(
        f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}: files of several seeds must differ in one number,"
        " the seed; or give a pattern with {seed} in its place."
    )
