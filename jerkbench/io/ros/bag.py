"""An open bag: its topics, and the messages of each as arrays; rosbags reads it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import unknown
from jerkbench.io.ros.bulk import read_in_bulk
from jerkbench.io.ros.decode import LAYOUTS, MessageBlock, decode, source_of
from jerkbench.io.ros.files import BagError, bag_errors, bag_files, storage_files, way_out

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader


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
        values: the fields by name, (n, k) each; `jerkbench.io.ros.decode.LAYOUTS` has the names.
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

    def rows(self, rows: BoolArray | IntArray, **changed: FloatArray) -> "Messages":
        """Return only ``rows``, with the fields of ``changed`` (of all rows, or of these) put in before."""
        values = {name: changed.get(name, value)[rows] for name, value in self.values.items()}
        return self._with(self.bag_ns[rows], self.stamp_ns[rows], values)

    def stamped(self, stamp_ns: IntArray) -> "Messages":
        """Return the same messages with other stamps."""
        return self._with(self.bag_ns, stamp_ns, self.values)

    def with_values(self, **changed: FloatArray) -> "Messages":
        """Return the same messages with other, or more, fields."""
        return self._with(self.bag_ns, self.stamp_ns, {**self.values, **changed})

    def _with(self, bag_ns: IntArray, stamp_ns: IntArray, values: Mapping[str, FloatArray]) -> "Messages":
        return Messages(self.topic, self.msgtype, self.frame_id, self.child_frame_id, bag_ns, stamp_ns, values)

    def rate_hz(self) -> float:
        """Mean rate of the recording; 0 of fewer than two messages."""
        duration_ns = int(np.ptp(self.bag_ns)) if len(self) > 1 else 0
        return 1e9 * (len(self) - 1) / duration_ns if duration_ns > 0 else 0.0


BLOCK = 8192
"""So many messages of a topic become arrays at once: the serialised ones of a long bag need not be kept."""

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


@dataclass
class _Collected:
    """The messages of one topic that are read so far."""

    fields: Sequence[str]
    count: int = 0
    bag_ns: list[int] = field(default_factory=list)
    stamps: list[IntArray] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)
    blocks: list[MessageBlock] = field(default_factory=list)


class Bag:
    """An open bag; `open_bag` makes it."""

    def __init__(self, path: Path, reader: "AnyReader", files: Sequence[Path]) -> None:
        """Take over an open ``reader`` of ``files``."""
        self.path, self._reader, self._files = path, reader, files
        infos = sorted(reader.topics.items())
        self.topics = tuple(Topic(name, info.msgtype or "several types", info.msgcount) for name, info in infos)

    def topic(self, name: str) -> Topic:
        """Return the topic ``name``.

        Raises:
            BagError: there is none; says what there is.
        """
        for topic in self.topics:
            if topic.name == name:
                return topic
        raise BagError(f"{self.path}: {unknown('topic', name, [topic.name for topic in self.topics])}")

    def read(self, wanted: Wanted, most: int | None = None) -> dict[str, Messages]:
        """Return the messages of each topic, in one pass over the bag.

        Args:
            wanted: which fields of which topics.
            most: only so many messages of each topic, the first ones.

        Raises:
            BagError: a topic is missing, of a type that is not read, or damaged.
        """
        for name in wanted:
            self._check_type(self.topic(name))
        messages = self._in_bulk(wanted) if most is None else None
        return messages or self._one_by_one(wanted, most)

    def _in_bulk(self, wanted: Wanted) -> dict[str, Messages] | None:
        """The quick way, which not every bag is made for; what it returns has as many messages as the index says."""
        if not wanted or not all(self.topic(name).count for name in wanted):
            return None
        types = {name: self.topic(name).msgtype for name in wanted}
        whole = read_in_bulk(self._connections(wanted), types, wanted)
        if whole is None or any(len(part.bag_ns) != self.topic(name).count for name, part in whole.items()):
            return None
        return {
            name: Messages(name, types[name], *part.block.strings, part.bag_ns, part.block.stamp_ns, part.block.values)
            for name, part in whole.items()
        }

    def _connections(self, names: Iterable[str]) -> dict[Path, dict[int, str]]:
        """Each file, and which of its connections have which topic."""
        files: dict[Path, dict[int, str]] = {file: {} for file in self._files}
        for connection in self._reader.connections:
            path = getattr(connection.owner, "path", None)
            if connection.topic in names and path in files:
                files[path][connection.id] = connection.topic
        return files

    def _one_by_one(self, wanted: Wanted, most: int | None) -> dict[str, Messages]:
        collected = {name: _Collected(fields) for name, fields in wanted.items()}
        with bag_errors(self.path, ", ".join(wanted)):
            for name, bag_ns, raw in self._messages(list(wanted)):
                pending = collected[name]
                if most is None or pending.count < most:
                    pending.count += 1
                    pending.bag_ns.append(bag_ns)
                    pending.raw.append(raw)
                elif all(pending.count >= most for pending in collected.values()):
                    break
                if len(pending.raw) >= BLOCK:
                    self._flush(name, pending)
        if most is None:
            self._check_counts({name: pending.count for name, pending in collected.items()})
        return {name: self._messages_of(name, pending) for name, pending in collected.items()}

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

    def _check_type(self, topic: Topic) -> None:
        if topic.msgtype not in LAYOUTS:
            raise BagError(
                f"{self.path}, topic {topic.name} is of type {topic.msgtype}; read are {', '.join(sorted(LAYOUTS))}:"
                " choose another topic."
            )

    def _check_counts(self, read: Mapping[str, int]) -> None:
        """Compare what was read with what the index promises: some damage raises nothing and ends the reading."""
        for name, count in read.items():
            if count != self.topic(name).count:
                raise BagError(
                    f"{self.path}, topic {name}: {count} messages can be read, and its index promises"
                    f" {self.topic(name).count}. {way_out(self.path)}"
                )

    def _flush(self, name: str, pending: _Collected) -> None:
        if pending.raw:
            with bag_errors(self.path, name):
                cdr, deserialise = self._reader.is2, self._reader.deserialize
                pending.blocks.append(
                    decode(pending.raw, self.topic(name).msgtype, pending.fields, deserialise, cdr=cdr)
                )
            pending.stamps.append(np.array(pending.bag_ns, dtype=np.int64))
            pending.raw.clear()
            pending.bag_ns.clear()

    def _messages_of(self, name: str, pending: _Collected) -> Messages:
        self._flush(name, pending)
        msgtype = self.topic(name).msgtype
        strings = pending.blocks[0].strings if pending.blocks else ("", "")
        sources = {name: source_of(msgtype, name) for name in pending.fields}
        widths = {name: part.count if first is None else 9 for name, (part, first) in sources.items()}
        values = {f: _joined([block.values.pop(f) for block in pending.blocks], width) for f, width in widths.items()}
        bag_ns, stamp_ns = _stamps(pending.stamps), _stamps([block.stamp_ns for block in pending.blocks])
        return Messages(name, msgtype, *strings, bag_ns, stamp_ns, values)


def _stamps(blocks: list[IntArray]) -> IntArray:
    return np.concatenate(blocks) if blocks else np.empty(0, dtype=np.int64)


def _joined(blocks: list[Any], width: int) -> Any:  # noqa: ANN401 - arrays of numbers
    return np.concatenate(blocks) if blocks else np.empty((0, width))


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
            bag = Bag(path, reader, storage_files(path))
        if not any(topic.count for topic in bag.topics):
            raise BagError(f"{path} holds {len(bag.topics)} topics and no message; record it again.")
        yield bag
    finally:
        reader.close()
