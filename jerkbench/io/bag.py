"""ROS bags: the files of a bag, the errors of damaged bags, and the messages as arrays, decoded by rosbags."""

import hashlib
import os
import pickle
import re
import warnings
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, RecordingError, unknown
from jerkbench.files import Distrusted, cache_folder, forget_oldest, read_trusted, write_trusted
from jerkbench.io.files import fingerprint, require_content

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

STRING = "std_msgs/msg/String"

_MAGIC = {b"#ROSBAG V": ".bag", b"SQLite format 3\0": ".db3", b"\x89MCAP0": ".mcap"}
"""First bytes of each bag format, and the suffix that rosbags expects for this format."""

_PART = re.compile(r"^(.*?)(_?\d{4}(-\d\d){5})?_(\d+)$")
"""File name of a part of a split bag: NAME_NUMBER, or NAME_TIME_NUMBER as written by `rosbag record`.

TIME is the start of the part.
"""


@contextmanager
def bag_errors(path: Path, topics: str = "") -> Iterator[None]:
    """Convert each exception that is not a `JerkbenchError` to a RecordingError that names ``path`` and ``topics``.

    For a damaged bag, rosbags raises exceptions of many types: its exception types, the exception types of lz4, bz2,
    zstd, SQLite and YAML, AssertionError and struct.error.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except PermissionError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}; change the permissions of the file.") from error
    except Exception as error:
        where, message = f"{path}, topic {topics}" if topics else f"{path}", " ".join(str(error).split()).rstrip(".")
        reason = f"{type(error).__name__}{': ' if message else ''}{message}"
        raise RecordingError(f"{where} cannot be read: {reason}. {repair_advice(path)}") from error


def repair_advice(path: Path) -> str:
    """Return advice for the repair of a damaged bag, which depends on the suffix of ``path``."""
    tool = {".bag": "`rosbag reindex`", ".mcap": "`mcap recover`"}.get(path.suffix, "`ros2 bag reindex`")
    return f"Copy the bag again from its source, or repair the bag with {tool}."


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return the paths to open: a file, the parts of a split ROS 1 bag in a folder, or the folder of a ROS 2 bag.

    Raises:
        RecordingError: the bag does not exist, a file is empty, or the content of a file does not match its suffix.
    """
    if not path.is_dir():
        return (_checked(path),)
    if (path / "metadata.yaml").exists():
        return (path,)
    parts = sorted(path.glob("*.bag"), key=_number) or sorted(path.glob("*.mcap")) or sorted(path.glob("*.db3"))
    if not parts:
        raise RecordingError(
            f"The folder {path} contains no metadata.yaml and no .bag, .mcap or .db3 file; give a bag."
        )
    if parts[0].suffix != ".bag" and len(parts) > 1:
        raise RecordingError(
            f"The folder {path} contains {len(parts)} files that end in {parts[0].suffix}, but no metadata.yaml; copy"
            " metadata.yaml to this folder, or create metadata.yaml with `ros2 bag reindex`."
        )
    if len({match[1] if (match := _PART.match(part.stem)) else part.name for part in parts}) > 1:
        raise RecordingError(
            f"The folder {path} contains {len(parts)} bags that are not parts of one split bag"
            f" ({', '.join(part.name for part in parts)}). Give one of these bags. The parts of a split bag have the"
            " names NAME_0.bag, NAME_1.bag, ..."
        )
    return tuple(map(_checked, parts))


def content_files(path: Path) -> tuple[Path, ...]:
    """Return all files of the bag, for the fingerprint of the bag.

    Raises:
        RecordingError: the bag does not exist, a file is empty, or the content of a file does not match its suffix.
    """
    inside = [file for top in bag_files(path) for file in (sorted(top.iterdir()) if top.is_dir() else [top])]
    return tuple(file for file in inside if file.is_file())


def missing_parts(paths: tuple[Path, ...]) -> list[int]:
    """Return the numbers of missing parts of a split bag (name_0.bag, name_1.bag, ...)."""
    numbers = [_number(path)[0] for path in paths]
    return sorted(set(range(max(numbers) + 1)) - set(numbers)) if len(numbers) > 1 else []


def _number(path: Path) -> tuple[int, str]:
    match = _PART.match(path.stem)
    return (int(match[4]) if match else -1, path.name)


def _checked(path: Path) -> Path:
    """Return the path, after a check that the content of the file matches its suffix."""
    require_content(path)
    with path.open("rb") as file:
        first = file.read(16)
    suffix = next((suffix for magic, suffix in _MAGIC.items() if first.startswith(magic)), "")
    if not suffix:
        raise RecordingError(
            f"{path} is neither a ROS 1 bag nor SQLite (.db3) nor mcap. The file is of another type, compressed, or"
            " damaged at its start; unpack the file or copy the file again."
        )
    if path.suffix != suffix:
        raise RecordingError(
            f"The content of {path} is a {suffix} file; rename the file so that its name ends in {suffix}."
        )
    return path


# Functions that return the numerical fields of a message.

Getter = Callable[[Any], Any]


def _axes(path: str, axes: str = "xyz") -> Getter:
    return attrgetter(*(f"{path}.{axis}" for axis in axes))


def _scalar(path: str) -> Getter:
    get = attrgetter(path)
    return lambda message: (get(message),)


def _block(path: str, first: int) -> Getter:
    """Return a getter of the 3 x 3 block of a 6 x 6 covariance that starts at row and column ``first``."""
    get, part = attrgetter(path), slice(first, first + 3)
    return lambda message: get(message).reshape(6, 6)[part, part].ravel()


_POSE = {
    "position": _axes("pose.pose.position"),
    "orientation": _axes("pose.pose.orientation", "xyzw"),
    "position_covariance": _block("pose.covariance", 0),
    "orientation_covariance": _block("pose.covariance", 3),
}
_TWIST = {"linear": _axes("twist.twist.linear"), "linear_covariance": _block("twist.covariance", 0)}

IMU, FIX, ODOMETRY = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "nav_msgs/msg/Odometry"
POSE_COVARIANCE, POSE = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped"
TWIST_COVARIANCE, TWIST = "geometry_msgs/msg/TwistWithCovarianceStamped", "geometry_msgs/msg/TwistStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"

FIELDS: dict[str, dict[str, Getter]] = {
    IMU: {
        "orientation": _axes("orientation", "xyzw"),
        "orientation_covariance": attrgetter("orientation_covariance"),
        "angular_velocity": _axes("angular_velocity"),
        "linear_acceleration": _axes("linear_acceleration"),
    },
    FIX: {
        "status": _scalar("status.status"),
        **{name: _scalar(name) for name in ("latitude", "longitude", "altitude")},
        "position_covariance": attrgetter("position_covariance"),
    },
    ODOMETRY: _POSE | _TWIST,
    POSE: {"position": _axes("pose.position"), "orientation": _axes("pose.orientation", "xyzw")},
    POSE_COVARIANCE: _POSE,
    TWIST: {"linear": _axes("twist.linear")},
    TWIST_COVARIANCE: _TWIST,
    VECTOR: {"linear": _axes("vector")},
}
"""Fields that are read from each message type, each with its getter."""


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of a topic, in the order in which they were recorded.

    Attributes:
        topic: name of the topic.
        msgtype: message type in the notation of ROS 2, for example sensor_msgs/msg/Imu.
        frame_id: frame of the first message, or an empty string.
        child_frame_id: child frame of the first message, or an empty string.
        bag_ns: (n,) times at which the messages were recorded, by the clock of the recording computer.
        stamp_ns: (n,) time stamps in the message headers, in nanoseconds since 1970.
        values: arrays (n, k) of the fields, by the name of the field in `FIELDS`.
    """

    topic: str
    msgtype: str
    frame_id: str
    child_frame_id: str
    bag_ns: IntArray
    stamp_ns: IntArray
    values: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return len(self.bag_ns)

    def __getitem__(self, name: str) -> FloatArray:
        return self.values[name]

    def rows(self, rows: BoolArray | IntArray) -> "Messages":
        """Return the messages that the mask or the indices ``rows`` select."""
        values = {name: value[rows] for name, value in self.values.items()}
        return replace(self, bag_ns=self.bag_ns[rows], stamp_ns=self.stamp_ns[rows], values=values)

    def stamped(self, stamp_ns: IntArray) -> "Messages":
        """Return a copy of the messages with the time stamps ``stamp_ns`` (n,)."""
        return replace(self, stamp_ns=stamp_ns)

    def with_values(self, **changed: FloatArray) -> "Messages":
        """Return a copy of the messages in which the fields ``changed`` are replaced or added."""
        return replace(self, values={**self.values, **changed})


class _Columns:
    """Growing buffers for the messages of a topic. Each number in the buffers needs only eight bytes."""

    def __init__(self, fields: Mapping[str, Getter]) -> None:
        self.getters = fields
        self.bag_ns, self.stamp_ns = array("q"), array("q")
        self.values = {name: array("d") for name in fields}
        self.frames = "", ""

    def append(self, bag_ns: int, message: Any) -> None:  # noqa: ANN401 - a class that rosbags makes at run time
        header = message.header
        if not self.bag_ns:
            self.frames = header.frame_id, getattr(message, "child_frame_id", "")
        self.bag_ns.append(bag_ns)
        self.stamp_ns.append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)
        for name, get in self.getters.items():
            self.values[name].extend(get(message))

    def messages(self, topic: str, msgtype: str) -> Messages:
        bag_ns, stamp_ns = (np.array(stamps, dtype=np.int64) for stamps in (self.bag_ns, self.stamp_ns))
        values = {
            name: np.array(numbers, dtype=np.float64).reshape(len(bag_ns), -1 if len(bag_ns) else 1)
            for name, numbers in self.values.items()
        }
        messages = Messages(topic, msgtype, *self.frames, bag_ns, stamp_ns, values)
        in_order = bool((np.diff(bag_ns) >= 0).all())
        return messages if in_order else messages.rows(np.argsort(bag_ns, kind="stable"))


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: name of the topic, with its namespace.
        msgtype: message type in the notation of ROS 2, for example sensor_msgs/msg/Imu.
        count: number of messages.
    """

    name: str
    msgtype: str
    count: int


class Bag:
    """An open bag, which the function `open_bag` creates."""

    def __init__(self, path: Path, reader: "AnyReader") -> None:
        """Store an open ``reader``, and list its topics."""
        self.path, self._reader = path, reader
        infos = sorted(reader.topics.items())
        self.topics = tuple(Topic(name, info.msgtype or "several types", info.msgcount) for name, info in infos)

    def topic(self, name: str) -> Topic:
        """Return the topic ``name``.

        Raises:
            RecordingError: the topic does not exist. The error message lists the topics of the bag.
        """
        topics = {topic.name: topic for topic in self.topics}
        if name not in topics:
            raise RecordingError(f"{self.path}: {unknown('topic', name, topics)}")
        return topics[name]

    def first(self, name: str, field: str, count: int) -> FloatArray:
        """Return a field (n, k) of the first ``count`` messages of a topic.

        Raises:
            RecordingError: the topic is missing or damaged.
        """
        return self._decoded({name: (field,)}, count)[name][field]

    def read(self, wanted: Mapping[str, Sequence[str]]) -> dict[str, Messages]:
        """Return the messages of each topic in ``wanted``, which maps each topic to the fields to read.

        The messages of a large bag are cached in a file.

        Raises:
            RecordingError: a topic is missing or damaged, or has an unsupported type.
        """
        files = content_files(self.path)
        if sum(file.stat().st_size for file in files) < MIN_CACHED_BYTES:
            return self._decoded(wanted)
        mark = fingerprint(files)
        key = f"{mark} {sorted(wanted.items())} {fingerprint((Path(__file__),))} {version('rosbags')}"
        path = cache_folder(BAGS) / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.pickle"
        messages = read_stored(path)
        if messages is None:
            messages = self._decoded(wanted)
            if fingerprint(content_files(self.path)) == mark:  # the bag was not changed during reading
                _store(messages, path)
        return messages

    def text(self, name: str) -> str:
        """Return the last message of a topic of type std_msgs/msg/String.

        Raises:
            RecordingError: the topic has no message, or the message is damaged.
        """
        with bag_errors(self.path, name):
            texts = [self._reader.deserialize(raw, STRING).data for _, _, raw in self._messages([name])]  # type: ignore[attr-defined]
        if not texts:
            raise RecordingError(f"{self.path}: the topic {name} has no message.")
        return str(texts[-1])

    def _decoded(self, wanted: Mapping[str, Sequence[str]], most: int | None = None) -> dict[str, Messages]:
        """Read the bag once, and return the messages of the topics, or only ``most`` messages from the start."""
        types = {name: self._type_of(name) for name in wanted}
        columns = {
            name: _Columns({field: FIELDS[types[name]][field] for field in fields}) for name, fields in wanted.items()
        }
        with bag_errors(self.path, ", ".join(wanted)):
            for name, bag_ns, raw in islice(self._messages(list(wanted)), most):
                columns[name].append(bag_ns, self._reader.deserialize(raw, types[name]))
            read = {name: column.messages(name, types[name]) for name, column in columns.items()}
        for name, messages in read.items():  # in some damaged bags, rosbags stops reading without an exception
            promised = self.topic(name).count
            if most is None and len(messages) != promised:
                raise RecordingError(
                    f"{self.path}, topic {name}: {len(messages)} messages can be read, but the index of the bag lists"
                    f" {promised} messages. {repair_advice(self.path)}"
                )
        return read

    def _messages(self, names: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        connections = [c for c in self._reader.connections if c.topic in names]
        if connections:  # for an empty list, rosbags would return the messages of all topics
            for connection, bag_ns, raw in self._reader.messages(connections):
                yield connection.topic, bag_ns, raw

    def _type_of(self, name: str) -> str:
        topic = self.topic(name)
        if topic.msgtype not in FIELDS:
            raise RecordingError(
                f"{self.path}: the topic {name} has the type {topic.msgtype}. Choose a topic with a supported type:"
                f" {', '.join(sorted(FIELDS))}."
            )
        return topic.msgtype


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a ROS 1 bag (a file, or a folder with the parts of a split bag) or a ROS 2 bag (folder, .db3, .mcap).

    Raises:
        RecordingError: the bag is missing, empty or damaged, or has no message.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    files = bag_files(path)
    store = get_typestore(Stores.ROS1_NOETIC if files[0].suffix == ".bag" else Stores.ROS2_HUMBLE)
    with bag_errors(path):
        reader = AnyReader(files, default_typestore=store)
        reader.open()
    try:
        with bag_errors(path):
            bag = Bag(path, reader)
        if not any(topic.count for topic in bag.topics):
            raise RecordingError(f"{path} contains {len(bag.topics)} topics but no message; record the bag again.")
        yield bag
    finally:
        reader.close()


# Text that lists the topics of a bag, so that a user can assign topics to roles.


def survey(bag: Bag) -> Iterator[str]:
    """Yield a line for each topic, and more lines with the delay and the medians of the fields of supported topics.

    For a covariance, only the medians of the variances are printed.

    Raises:
        RecordingError: the messages of a topic are damaged.
    """
    import pandas as pd

    for topic in bag.topics:
        counted = f"{topic.name} ({topic.msgtype}): {topic.count} messages"
        if topic.msgtype not in FIELDS or not topic.count:
            yield counted
            continue
        messages = bag.read({topic.name: tuple(FIELDS[topic.msgtype])})[topic.name]
        frames = " in ".join(name for name in (messages.child_frame_id, messages.frame_id) if name)
        duration_s = float(np.ptp(messages.bag_ns)) * 1e-9
        rate = f"{(topic.count - 1) / duration_s:.4g} Hz" if duration_s else "no rate"
        yield f"{counted}, {rate}, frame {frames or '-'}"
        low, middle, high = np.percentile((messages.bag_ns - messages.stamp_ns) * 1e-9, [0, 50, 100])
        yield f"    recorded {middle:.3f} s after its stamp ({low:.3f} to {high:.3f} s)"
        for name, values in dict(messages.values).items():
            damaged = int((~np.isfinite(values)).any(axis=1).sum())
            count = f"; NaN or infinite in {damaged} of {len(values)} messages" if damaged else ""
            shown = values[:, [0, 4, 8]] if values.shape[1] == 9 else values
            medians = ", ".join(f"{median:.8g}" for median in pd.DataFrame(shown).median())
            yield f"    {name.replace('_', ' ')} (median): {medians}{count}"


# The cache of decoded messages.

BAGS, PATTERN = "bags", "*.pickle"
"""Name of the cache, and the pattern of its files."""

MIN_CACHED_BYTES, MAX_CACHED_BYTES = 4_000_000, 2_000_000_000
"""Minimum size of a bag that is cached, and maximum size of the cache. The least recently used files are deleted."""


def _store(messages: dict[str, Messages], path: Path) -> None:
    try:
        write_trusted(path, pickle.dumps(messages, 5))
        forget_oldest(path.parent, PATTERN, MAX_CACHED_BYTES)
    except OSError as error:
        warnings.warn(f"{path.parent} cannot be written ({error}), so each run decodes bags again.", stacklevel=2)


def read_stored(path: Path) -> dict[str, Messages] | None:
    """Return the messages in a cached file, or None if the file does not exist or another user can have written it."""
    with suppress(Distrusted):
        if content := read_trusted(path):
            with suppress(OSError):
                os.utime(path)  # set the time of the last use, unless the cache is read-only
            messages: dict[str, Messages] = pickle.loads(content)  # noqa: S301 - only this user can have written it
            return messages
    return None
