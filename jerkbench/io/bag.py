"""ROS bags: finding the files, the error of a damaged one, and the messages of topics as arrays. rosbags decodes."""

import hashlib
import os
import re
import warnings
import zipfile
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, RecordingError, unknown
from jerkbench.files import cache_folder, forget_oldest, write_atomically
from jerkbench.io.files import NO_ARRAY, fingerprint

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

STRING = "std_msgs/msg/String"

_MAGIC = {b"#ROSBAG V": ".bag", b"SQLite format 3\0": ".db3", b"\x89MCAP0": ".mcap"}
"""The first bytes of a bag, and the suffix that rosbags expects."""

_PART = re.compile(r"^(.*?)(_?\d{4}(-\d\d){5})?_(\d+)$")
"""Name of a part of a split bag: NAME_NUMBER; `rosbag record` writes the start of each part before the number."""


class BagError(RecordingError):
    """A bag that cannot be read: which file, which topic, and how to repair it."""


@contextmanager
def bag_errors(path: Path, topics: str = "") -> Iterator[None]:
    """Turn every error into a BagError that names ``path`` and ``topics``.

    rosbags raises a dozen unrelated types on damage: its own, those of lz4, bz2, zstd, SQLite and YAML, and those of
    failed assertions and structs. Only errors of jerkbench pass unchanged.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except PermissionError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}; give yourself the right to read it.") from error
    except Exception as error:
        where, message = f"{path}, topic {topics}" if topics else f"{path}", " ".join(str(error).split()).rstrip(".")
        reason = f"{type(error).__name__}{': ' if message else ''}{message}"
        raise BagError(f"{where} cannot be read: {reason}. {repair_advice(path)}") from error


def repair_advice(path: Path) -> str:
    """Return how to repair a damaged bag."""
    tool = {".bag": "`rosbag reindex`", ".mcap": "`mcap recover`"}.get(path.suffix, "`ros2 bag reindex`")
    return f"Copy it again from where it was recorded, or repair it with {tool}."


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return the paths to open: a file, the parts of a split ROS 1 bag in a folder, or the folder of a ROS 2 bag.

    Raises:
        BagError: there is no bag, a file is empty, or its content does not fit its suffix.
    """
    if not path.is_dir():
        return (_checked(path),)
    if (path / "metadata.yaml").exists():
        return (path,)
    parts = sorted(path.glob("*.bag"), key=_number) or sorted(path.glob("*.mcap")) or sorted(path.glob("*.db3"))
    if not parts:
        raise BagError(f"{path} holds no metadata.yaml and no .bag, .mcap or .db3; give the bag itself.")
    if parts[0].suffix != ".bag" and len(parts) > 1:
        raise BagError(
            f"{path} holds {len(parts)} files ending in {parts[0].suffix} but no metadata.yaml; copy it there, or let"
            " `ros2 bag reindex` write it."
        )
    if len({match[1] if (match := _PART.match(part.stem)) else part.name for part in parts}) > 1:
        raise BagError(
            f"{path} holds {len(parts)} bags that are no parts of one ({', '.join(part.name for part in parts)}):"
            " give one of them; the parts of one are called NAME_0.bag, NAME_1.bag, ..."
        )
    return tuple(map(_checked, parts))


def content_files(path: Path) -> tuple[Path, ...]:
    """Return all files of the bag, for its fingerprint.

    Raises:
        BagError: as in `bag_files`.
    """
    inside = [file for top in bag_files(path) for file in (sorted(top.iterdir()) if top.is_dir() else [top])]
    return tuple(file for file in inside if file.is_file())


def missing_parts(paths: tuple[Path, ...]) -> list[int]:
    """Return the numbers that are missing between the parts of a split bag (name_0.bag, name_1.bag, ...)."""
    numbers = [_number(path)[0] for path in paths]
    return sorted(set(range(max(numbers) + 1)) - set(numbers)) if len(numbers) > 1 else []


def _number(path: Path) -> tuple[int, str]:
    match = _PART.match(path.stem)
    return (int(match[4]) if match else -1, path.name)


def _checked(path: Path) -> Path:
    """Return the path of a file whose content is what its suffix says."""
    try:
        with path.open("rb") as file:
            first = file.read(16)
    except FileNotFoundError as error:
        raise BagError(f"There is no bag {path}; correct the path.") from error
    except OSError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}.") from error
    if not first:
        raise BagError(f"{path} is empty; copy it again from where it was recorded.")
    suffix = next((suffix for magic, suffix in _MAGIC.items() if first.startswith(magic)), "")
    if not suffix:
        raise BagError(
            f"{path} begins neither like a ROS 1 bag nor like SQLite (.db3) or mcap; it is another kind of file,"
            " compressed as a whole, or damaged at its start: unpack it or copy it again."
        )
    if path.suffix != suffix:
        raise BagError(f"{path} is a {suffix} file by its content; rename it so that it ends in {suffix}.")
    return path


# The numbers of a message behind its header.

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
"""The fields that are read of each type of message."""


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of a topic, in the order in which they were recorded.

    Attributes:
        topic: name of the topic.
        msgtype: type as in ROS 2: sensor_msgs/msg/Imu.
        frame_id: of the first message; empty if there is none.
        child_frame_id: of the first message; empty if there is none.
        bag_ns: (n,) times of recording, by the recording computer's clock.
        stamp_ns: (n,) stamps of the headers, nanoseconds since 1970.
        values: the fields by the names of `FIELDS`, (n, k) each.
    """

    topic: str
    msgtype: str
    frame_id: str
    child_frame_id: str
    bag_ns: IntArray
    stamp_ns: IntArray
    values: Mapping[str, FloatArray]

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.bag_ns)

    def __getitem__(self, name: str) -> FloatArray:
        """Return the field ``name``."""
        return self.values[name]

    def rows(self, rows: BoolArray | IntArray) -> "Messages":
        """Return only ``rows``."""
        values = {name: value[rows] for name, value in self.values.items()}
        return replace(self, bag_ns=self.bag_ns[rows], stamp_ns=self.stamp_ns[rows], values=values)

    def stamped(self, stamp_ns: IntArray) -> "Messages":
        """Return the same messages with other stamps."""
        return replace(self, stamp_ns=stamp_ns)

    def with_values(self, **changed: FloatArray) -> "Messages":
        """Return the same messages with other, or more, fields."""
        return replace(self, values={**self.values, **changed})

    def rate_hz(self) -> float:
        """Return the mean rate of the recording; 0 for fewer than two messages."""
        duration_ns = int(np.ptp(self.bag_ns)) if len(self) > 1 else 0
        return 1e9 * (len(self) - 1) / duration_ns if duration_ns > 0 else 0.0


class _Columns:
    """Buffers of a topic's messages, eight bytes per number."""

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
        name: with its namespace.
        msgtype: as ROS 2 writes it: sensor_msgs/msg/Imu.
        count: the number of messages.
    """

    name: str
    msgtype: str
    count: int


class Bag:
    """An open bag; `open_bag` opens it."""

    def __init__(self, path: Path, reader: "AnyReader") -> None:
        """Take over an open ``reader``."""
        self.path, self._reader = path, reader
        infos = sorted(reader.topics.items())
        self.topics = tuple(Topic(name, info.msgtype or "several types", info.msgcount) for name, info in infos)

    def topic(self, name: str) -> Topic:
        """Return the topic ``name``.

        Raises:
            BagError: there is no such topic; lists the topics.
        """
        topics = {topic.name: topic for topic in self.topics}
        if name not in topics:
            raise BagError(f"{self.path}: {unknown('topic', name, topics)}")
        return topics[name]

    def first(self, name: str, field: str, count: int) -> FloatArray:
        """Return (n, k) a field of the first ``count`` messages of a topic.

        Raises:
            BagError: the topic is missing or damaged.
        """
        return self._decoded({name: (field,)}, count)[name][field]

    def read(self, wanted: Mapping[str, Sequence[str]]) -> dict[str, Messages]:
        """Return the messages of each topic with the fields ``wanted``; those of a large bag are cached.

        Raises:
            BagError: a topic is missing, its type cannot be read, or it is damaged.
        """
        files = content_files(self.path)
        if sum(file.stat().st_size for file in files) < MIN_CACHED_BYTES:
            return self._decoded(wanted)
        mark = fingerprint(files)
        paths = {name: _cache_path(mark, name, fields) for name, fields in wanted.items()}
        stored = {name: messages for name, path in paths.items() if (messages := read_stored(path))}
        decoded = self._decoded({name: fields for name, fields in wanted.items() if name not in stored})
        if fingerprint(content_files(self.path)) == mark:  # otherwise the bag changed while it was read
            for name, messages in decoded.items():
                _store(messages, paths[name])
        return {name: stored.get(name) or decoded[name] for name in wanted}

    def text(self, name: str) -> str:
        """Return the last message of a topic of type std_msgs/msg/String.

        Raises:
            BagError: there is no message, or it is damaged.
        """
        with bag_errors(self.path, name):
            texts = [self._reader.deserialize(raw, STRING).data for _, _, raw in self._messages([name])]  # type: ignore[attr-defined]
        if not texts:
            raise BagError(f"{self.path}: the topic {name} has no message.")
        return str(texts[-1])

    def _decoded(self, wanted: Mapping[str, Sequence[str]], most: int | None = None) -> dict[str, Messages]:
        """Read the topics in one pass over the bag, or only the first ``most`` messages of each."""
        types = {name: self._type_of(name) for name in wanted}
        columns = {
            name: _Columns({field: FIELDS[types[name]][field] for field in fields}) for name, fields in wanted.items()
        }
        with bag_errors(self.path, ", ".join(wanted)):
            for name, bag_ns, raw in self._messages(list(wanted)):
                if most is None or len(columns[name].bag_ns) < most:
                    columns[name].append(bag_ns, self._reader.deserialize(raw, types[name]))
                elif all(len(column.bag_ns) >= most for column in columns.values()):
                    break
            read = {name: column.messages(name, types[name]) for name, column in columns.items()}
        for name, messages in read.items():  # some damage raises no error and ends the reading
            promised = self.topic(name).count
            if most is None and len(messages) != promised:
                raise BagError(
                    f"{self.path}, topic {name}: {len(messages)} messages can be read, and its index promises"
                    f" {promised}. {repair_advice(self.path)}"
                )
        return read

    def _messages(self, names: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        connections = [c for c in self._reader.connections if c.topic in names]
        if connections:  # rosbags takes an empty list as all of them
            for connection, bag_ns, raw in self._reader.messages(connections):
                yield connection.topic, bag_ns, raw

    def _type_of(self, name: str) -> str:
        topic = self.topic(name)
        if topic.msgtype not in FIELDS:
            raise BagError(
                f"{self.path}, topic {name} is of type {topic.msgtype}; read are {', '.join(sorted(FIELDS))}:"
                " choose another topic."
            )
        return topic.msgtype


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a ROS 1 bag (also a folder of split ones) or a ROS 2 bag (folder, .db3, .mcap).

    Raises:
        BagError: it is missing, empty, damaged, or holds no message.
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
            raise BagError(f"{path} holds {len(bag.topics)} topics and no message; record it again.")
        yield bag
    finally:
        reader.close()


# The cache of decoded messages.

BAGS, PATTERN = "bags", "*.npz"
"""The kind of cache, and its files."""

MIN_CACHED_BYTES, MAX_CACHED_BYTES = 4_000_000, 2_000_000_000
"""A smaller bag is read quickly enough; the files that were not used for the longest time are deleted first."""

DAMAGE = (*NO_ARRAY, KeyError, AttributeError, RuntimeError, zipfile.BadZipFile)
"""Errors of a damaged or deleted file of the cache; the bag itself is read again."""


def _cache_path(mark: str, topic: str, fields: Sequence[str]) -> Path:
    key = f"{mark} {topic} {' '.join(fields)} {_reader_digest()}"
    return cache_folder(BAGS) / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


def _store(messages: Messages, path: Path) -> None:
    names = [messages.topic, messages.msgtype, messages.frame_id, messages.child_frame_id]
    arrays: dict[str, Any] = {"names": np.array(names), "bag_ns": messages.bag_ns, "stamp_ns": messages.stamp_ns}
    arrays |= {f"value {name}": value for name, value in messages.values.items()}
    try:
        write_atomically(path, lambda partial: np.savez(partial, **arrays))
        forget_oldest(path.parent, PATTERN, MAX_CACHED_BYTES)
    except OSError as error:
        warnings.warn(f"{path.parent} cannot be written ({error}); bags are read anew each time.", stacklevel=2)


def read_stored(path: Path) -> Messages | None:
    """Return the messages in a file of the cache; None if it does not exist or is damaged."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:  # closed on damage too
            arrays = {name: file[name] for name in file.files}
        topic, msgtype, frame, child = arrays.pop("names").tolist()
        bag_ns, stamp_ns = arrays.pop("bag_ns"), arrays.pop("stamp_ns")
        with suppress(OSError):
            os.utime(path)  # the file was used just now; a read-only cache stays as it is
        values = {name.removeprefix("value "): value for name, value in arrays.items()}
        return Messages(topic, msgtype, frame, child, bag_ns, stamp_ns, values)
    except DAMAGE:
        return None


@cache
def _reader_digest() -> str:
    """Hash of this module: messages that another version stored are not read."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest() + version("rosbags")
