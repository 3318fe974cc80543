"""An open bag: its topics, and the messages of each as arrays; rosbags reads it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import unknown
from jerkbench.io.ros.decode import LAYOUTS, MessageBlock, decode, source_of
from jerkbench.io.ros.files import BagError, bag_errors, bag_files, way_out

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
                cdr, deserialise = self._reader.is2, self._reader.deserialize
                block = decode(raw, types[name], wanted[name], deserialise, cdr=cdr)
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
