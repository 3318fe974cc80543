"""A fresh, indexed bag from the intact part of a ROS 1 bag that was cut off or damaged."""

import mmap
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.files import write_atomically
from jerkbench.readers.ros.errors import BagError, bag_errors
from jerkbench.readers.ros.records import MAGIC, MESSAGE, Record, chunks, header_fields, inside

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Writer


@dataclass
class Salvaged:
    """The result of a salvage.

    Attributes:
        messages: how many, by topic.
        chunks: how many had something whole in them.
        cut_chunks: how many of these were cut short or damaged inside, or gave nothing.
        lost_bytes: of damaged stretches between chunks.
    """

    messages: dict[str, int] = field(default_factory=dict)
    chunks: int = 0
    cut_chunks: int = 0
    lost_bytes: int = 0


def salvage(source: Path, target: Path) -> Salvaged:
    """Write all whole messages of ``source`` to the new bag ``target``.

    Raises:
        BagError: there is no such file, it is no ROS 1 bag, nothing in it is whole, or the target is there already.
    """
    content = _content(source)
    if target.exists():
        raise BagError(f"{target} is there already; delete it or give another name.")
    if target.suffix != ".bag":
        raise BagError(f"{target} does not end in .bag, and a ROS 1 bag is what is written; give such a name.")
    saved = Salvaged()
    with bag_errors(source):
        write_atomically(target, lambda partial: _write(content, partial, saved, source))
    return saved


def _content(source: Path) -> memoryview:
    """The file's bytes, read by the system as they are needed: a bag may be larger than the memory."""
    try:
        with source.open("rb") as file:
            first = file.read(8)
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if first else b""
    except FileNotFoundError as error:
        raise BagError(f"There is no bag {source}; correct the path.") from error
    except OSError as error:
        raise BagError(f"{source} cannot be read: {error.strerror}.") from error
    if first != MAGIC[:8]:
        raise BagError(
            f"{source} is no ROS 1 bag by its first bytes; only those can be salvaged. `mcap recover` and SQLite's"
            " `.recover` do it for the others."
        )
    return memoryview(content)


def _write(content: memoryview, target: Path, saved: Salvaged, source: Path) -> None:
    from rosbags.rosbag1 import Writer

    with Writer(target) as writer:
        connections: dict[bytes, Connection] = {}
        for chunk in chunks(content):
            if isinstance(chunk, int):
                saved.lost_bytes += chunk
            else:
                _copy(chunk, writer, connections, saved)
    if not saved.messages:
        raise BagError(f"{source} has no whole message in it ({len(content)} bytes); nothing can be salvaged.")


def _copy(chunk: Record, writer: "Writer", connections: "dict[bytes, Connection]", saved: Salvaged) -> None:
    size = 0
    for record in inside(chunk):
        size = record.end
        number = record.fields.get(b"conn", b"")
        if record.op != MESSAGE:
            if number not in connections:
                _connect(record, number, writer, connections)
        elif number in connections and len(record.fields.get(b"time", b"")) == 8:
            connection = connections[number]
            writer.write(connection, _time_ns(record.fields[b"time"]), record.data)
            saved.messages[connection.topic] = saved.messages.get(connection.topic, 0) + 1
    saved.chunks += size > 0
    saved.cut_chunks += not chunk.whole or size != int.from_bytes(chunk.fields.get(b"size", b""), "little")


def _connect(record: Record, number: bytes, writer: "Writer", connections: "dict[bytes, Connection]") -> None:
    header = header_fields(record.data)
    topic, name, definition, md5 = (
        values.get(key, b"").decode(errors="replace")
        for values, key in (
            (record.fields, b"topic"),
            (header, b"type"),
            (header, b"message_definition"),
            (header, b"md5sum"),
        )
    )
    if topic and name.count("/") == 1 and md5:
        caller = header[b"callerid"].decode(errors="replace") if b"callerid" in header else None
        known = {(c.topic, c.msgtype, c.digest): c for c in connections.values()}
        msgtype = name.replace("/", "/msg/")
        connections[number] = known.get((topic, msgtype, md5)) or writer.add_connection(
            topic, msgtype, msgdef=definition, md5sum=md5, callerid=caller
        )


def _time_ns(time: bytes) -> int:
    return int.from_bytes(time[:4], "little") * 1_000_000_000 + int.from_bytes(time[4:], "little")
