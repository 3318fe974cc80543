"""A bag: its files, the one error of a damaged one, its topics, and their messages as arrays; rosbags reads it."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, RecordingError, unknown
from jerkbench.io.bag_decode import LAYOUTS, MessageBlock, decode, source_of

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader


# The one error for all that libraries raise on a damaged bag.


class BagError(RecordingError):
    """A bag that cannot be read: which file, which topic, and the way out."""


@contextmanager
def bag_errors(path: Path, topic: str = "") -> Iterator[None]:
    """Turn whatever is raised inside into a BagError that names ``path`` and ``topic``.

    rosbags raises a dozen unrelated types on damage (its own, those of lz4, bz2, zstd, SQLite and YAML, and those of
    Python where an assertion or a struct fails), so that everything but our own errors is caught here.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except PermissionError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}; give yourself the right to read it.") from error
    except Exception as error:
        where, message = f"{path}, topic {topic}" if topic else f"{path}", " ".join(str(error).split()).rstrip(".")
        reason = f"{type(error).__name__}{': ' if message else ''}{message}"
        raise BagError(f"{where} cannot be read: {reason}. {way_out(path)}") from error


def way_out(path: Path) -> str:
    """Return what to do about a damaged bag."""
    repair = {".bag": "`rosbag reindex`", ".mcap": "`mcap recover`"}.get(path.suffix, "`ros2 bag reindex`")
    return f"Copy it again from where it was recorded, or repair it with {repair}."


_MAGIC = {b"#ROSBAG V": ".bag", b"SQLite format 3\0": ".db3", b"\x89MCAP0": ".mcap"}
"""First bytes of a file, and the suffix that it needs to be read."""

_SPLIT = re.compile(r"^(.*)_(\d+)$")
_STARTED = re.compile(r"_?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d$")
"""The time that `rosbag record` writes before the number of a part: the part's begin."""


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return what to open: one file, the parts of a split ROS 1 bag in a folder, or the folder of a ROS 2 bag.

    Raises:
        BagError: there is nothing, it is empty, or its content is not what its suffix says.
    """
    if path.is_dir():
        return (path,) if (path / "metadata.yaml").exists() else _parts(path)
    return (_checked(path),)


def content_files(path: Path) -> tuple[Path, ...]:
    """Return every file whose bytes make the bag, for its fingerprint.

    Raises:
        BagError: as in `bag_files`.
    """
    inside = [p for top in bag_files(path) for p in (sorted(top.iterdir()) if top.is_dir() else [top])]
    return tuple(p for p in inside if p.is_file())


def missing_parts(paths: tuple[Path, ...]) -> list[int]:
    """Return the numbers that are missing between the parts of split bags (name_0.bag, name_1.bag, ...)."""
    numbers = [_number(path)[0] for path in paths]
    return sorted(set(range(max(numbers) + 1)) - set(numbers)) if len(numbers) > 1 else []


def _parts(folder: Path) -> tuple[Path, ...]:
    parts = sorted(folder.glob("*.bag"), key=_number) or sorted(folder.glob("*.mcap")) or sorted(folder.glob("*.db3"))
    if not parts:
        raise BagError(f"{folder} holds no metadata.yaml and no .bag, .mcap or .db3; give the bag itself.")
    if parts[0].suffix != ".bag" and len(parts) > 1:
        raise BagError(
            f"{folder} holds {len(parts)} files ending in {parts[0].suffix} but no metadata.yaml; copy it there, or let"
            " `ros2 bag reindex` write it."
        )
    if len({_drive(part) for part in parts}) > 1:
        raise BagError(
            f"{folder} holds {len(parts)} bags that are no parts of one ({', '.join(part.name for part in parts)}):"
            " give one of them; the parts of one are called NAME_0.bag, NAME_1.bag, ..."
        )
    return tuple(map(_checked, parts))


def _drive(part: Path) -> str:
    """Return the common part of the names of one drive's parts; of any other file, its own name."""
    match = _SPLIT.match(part.stem)
    return f"{_STARTED.sub('', match[1])}_*" if match else part.name


def _number(path: Path) -> tuple[int, str]:
    match = _SPLIT.match(path.stem)
    return (int(match[2]) if match else -1, path.name)


def first_bytes(path: Path) -> bytes:
    """Return the first 16 bytes of a bag.

    Raises:
        BagError: there is no such file, or it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(16)
    except FileNotFoundError as error:
        raise BagError(f"There is no bag {path}; correct the path.") from error
    except OSError as error:
        raise BagError(f"{path} cannot be read: {error.strerror}.") from error


def _checked(path: Path) -> Path:
    """Return the path of a file whose content is what its suffix says."""
    first = first_bytes(path)
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


# The container of one topic's messages, as arrays.


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of a topic, in the order in which they were recorded.

    Attributes:
        topic: its name.
        msgtype: its type, as ROS 2 writes it: sensor_msgs/msg/Imu.
        frame_id: of the first message; empty where there is none.
        child_frame_id: the same.
        bag_ns: (n,) when each was recorded, by the recording computer's clock.
        stamp_ns: (n,) stamps of the headers, nanoseconds since 1970.
        values: the fields by name, (n, k) each; `jerkbench.io.bag_decode.LAYOUTS` has the names.
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
        """Mean rate of the recording; 0 of fewer than two messages."""
        duration_ns = int(np.ptp(self.bag_ns)) if len(self) > 1 else 0
        return 1e9 * (len(self) - 1) / duration_ns if duration_ns > 0 else 0.0


BLOCK = 8192
"""So many messages of a topic become arrays at once: the serialised ones of a long bag need not be kept."""

Blocks = list[tuple[IntArray, MessageBlock]]
"""When messages were recorded (n,), and what was read of them, block by block."""

Wanted = Mapping[str, Sequence[str]]
"""Topics, and the fields of each that are read."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: with its namespace.
        msgtype: as ROS 2 writes it: sensor_msgs/msg/Imu.
        count: how many messages there are.
    """

    name: str
    msgtype: str
    count: int


class Bag:
    """An open bag; `open_bag` makes it."""

    def __init__(self, path: Path, reader: "AnyReader") -> None:
        """Take over an open ``reader``."""
        self.path, self._reader = path, reader
        infos = sorted(reader.topics.items())
        self.topics = tuple(Topic(name, info.msgtype or "several types", info.msgcount) for name, info in infos)

    def topic(self, name: str) -> Topic:
        """Return the topic ``name``.

        Raises:
            BagError: there is none; says what there is.
        """
        topics = {topic.name: topic for topic in self.topics}
        if name not in topics:
            raise BagError(f"{self.path}: {unknown('topic', name, topics)}")
        return topics[name]

    def read(self, wanted: Wanted, most: int | None = None) -> dict[str, Messages]:
        """Return the messages of each topic, in one pass over the bag.

        Args:
            wanted: which fields of which topics.
            most: only so many messages of each topic, the first ones.

        Raises:
            BagError: a topic is missing, of a type that is not read, or damaged.
        """
        types = {name: self._type_of(name) for name in wanted}
        waiting: dict[str, list[tuple[int, bytes]]] = {name: [] for name in wanted}
        read: dict[str, Blocks] = {name: [] for name in wanted}
        counts = dict.fromkeys(wanted, 0)

        def flush(name: str) -> None:
            times, raw = zip(*waiting[name], strict=True)
            with bag_errors(self.path, name):
                block = decode(raw, types[name], wanted[name], self._reader.deserialize)
            read[name].append((np.array(times, dtype=np.int64), block))
            waiting[name].clear()

        with bag_errors(self.path, ", ".join(wanted)):
            for name, bag_ns, raw in self._messages(list(wanted)):
                if most is None or counts[name] < most:
                    counts[name] += 1
                    waiting[name].append((bag_ns, raw))
                elif all(count >= most for count in counts.values()):
                    break
                if len(waiting[name]) >= BLOCK:
                    flush(name)
        for name in wanted:
            if waiting[name]:
                flush(name)
            self._check_count(name, counts[name], most)
        return {name: self._joined(name, fields, read[name]) for name, fields in wanted.items()}

    def text(self, name: str) -> str:
        """Return the last message of a topic of type std_msgs/msg/String."""
        with bag_errors(self.path, name):
            texts = [self._reader.deserialize(raw, "std_msgs/msg/String").data for _, _, raw in self._messages([name])]  # type: ignore[attr-defined]
        if not texts:
            raise BagError(f"{self.path}: the topic {name} has no message.")
        return str(texts[-1])

    def _messages(self, names: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        connections = [c for c in self._reader.connections if c.topic in names]
        if connections:  # an empty list would mean all of them
            for connection, bag_ns, raw in self._reader.messages(connections):
                yield connection.topic, bag_ns, raw

    def _type_of(self, name: str) -> str:
        topic = self.topic(name)
        if topic.msgtype not in LAYOUTS:
            raise BagError(
                f"{self.path}, topic {name} is of type {topic.msgtype}; read are {', '.join(sorted(LAYOUTS))}:"
                " choose another topic."
            )
        return topic.msgtype

    def _check_count(self, name: str, count: int, most: int | None) -> None:
        """Compare what was read with what the index promises: some damage raises nothing and ends the reading."""
        promised = self.topic(name).count
        if most is None and count != promised:
            raise BagError(
                f"{self.path}, topic {name}: {count} messages can be read, and its index promises {promised}."
                f" {way_out(self.path)}"
            )

    def _joined(self, name: str, fields: Sequence[str], parts: Blocks) -> Messages:
        """The blocks of a topic as one, in the order in which they were recorded; takes the values out of them."""
        msgtype, values = self.topic(name).msgtype, {}
        for wanted in fields:
            part, first = source_of(msgtype, wanted)
            empty = np.empty((0, part.count if first is None else 9))
            values[wanted] = np.concatenate([empty, *(block.values.pop(wanted) for _, block in parts)])
        none = np.empty(0, dtype=np.int64)
        bag_ns = np.concatenate([none, *(times for times, _ in parts)])
        stamp_ns = np.concatenate([none, *(block.stamp_ns for _, block in parts)])
        strings = parts[0][1].strings if parts else ("", "")
        messages = Messages(name, msgtype, *strings, bag_ns, stamp_ns, values)
        in_order = bool((np.diff(bag_ns) >= 0).all())
        return messages if in_order else messages.rows(np.argsort(bag_ns, kind="stable"))


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
