"""A fresh, indexed bag from the intact part of a ROS 1 bag that was cut off or damaged.

Source: the bag format 2.0, wiki.ros.org/Bags/Format/2.0.
"""

import mmap
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

from jerkbench.files import write_atomically
from jerkbench.io.ros.files import BagError, bag_errors

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Writer


# The records of a ROS 1 bag, one after the other, without its index; damaged stretches are passed
# over.

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, INDEX, CHUNK, CONNECTION = 2, 4, 5, 7
LONGEST_HEADER = 64 * 1024
"""No record has a longer header (a connection's has a topic in it)."""

LARGEST_CHUNK = 1 << 31
CHUNK_FIELD = b"compression="
"""Only a chunk's header has this field, in the first `CHUNK_FIELD_WITHIN` bytes: where reading can begin again."""
CHUNK_FIELD_WITHIN = 80


@dataclass(frozen=True)
class Record:
    """A record.

    Attributes:
        op: what it is: `MESSAGE`, `CHUNK`, `CONNECTION` or something of the index.
        fields: of its header.
        data: what follows the header; shorter than promised where the file ends.
        whole: whether all of it is there.
        end: where the next one begins.
    """

    op: int
    fields: dict[bytes, bytes]
    data: memoryview
    whole: bool
    end: int


def read_record(content: memoryview, at: int) -> Record | None:
    """Return the record that begins at ``at``, or None where none begins."""
    header_size = _u32(content, at)
    if header_size is None or not 0 < header_size <= LONGEST_HEADER:
        return None
    begin = at + 4 + header_size
    fields = _fields(content[at + 4 : begin])
    size = _u32(content, begin)
    if fields is None or size is None or len(fields.get(b"op", b"")) != 1 or size > LARGEST_CHUNK:
        return None
    data = content[begin + 4 : begin + 4 + size]
    return Record(fields[b"op"][0], fields, data, len(data) == size, begin + 4 + size)


def chunks(content: memoryview) -> Iterator[Record | int]:
    """Yield each chunk of a bag's bytes, and, for each damaged stretch, how many bytes were passed over."""
    at = len(MAGIC)
    while at < len(content):
        record = read_record(content, at)
        if record is not None:
            if record.op == CHUNK:
                yield record
            if record.whole:
                at = record.end
                continue
        resumed = _next_chunk(content, at + 1)
        if record is None or record.op != CHUNK or resumed < len(content):
            yield resumed - at
        at = resumed


def inside(chunk: Record) -> Iterator[Record]:
    """Yield the whole messages and connections of a chunk, up to where it is damaged."""
    content = memoryview(decompressed(chunk))
    at = 0
    while at < len(content):
        record = read_record(content, at)
        if record is None or not record.whole:
            return
        if record.op in (MESSAGE, CONNECTION):
            yield record
        at = record.end


def decompressed(chunk: Record) -> bytes:
    """Return all that can be decompressed, of a chunk that was cut too; nothing where it is damaged."""
    name = chunk.fields.get(b"compression", b"").decode(errors="replace")
    try:
        return _DECOMPRESSORS[name](bytes(chunk.data)) if name in _DECOMPRESSORS else b""
    except (OSError, RuntimeError, EOFError, ValueError, MemoryError):  # what bz2 and lz4 raise on damage
        return b""


def _bz2(data: bytes) -> bytes:
    import bz2

    return bz2.BZ2Decompressor().decompress(data)


def _lz4(data: bytes) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return cast("bytes", LZ4FrameDecompressor().decompress(data))


_DECOMPRESSORS: dict[str, Callable[[bytes], bytes]] = {"none": bytes, "bz2": _bz2, "lz4": _lz4}


def _fields(header: memoryview) -> dict[bytes, bytes] | None:
    fields, at = {}, 0
    while at < len(header):
        size = _u32(header, at)
        if size is None or at + 4 + size > len(header):
            return None
        name, equals, value = bytes(header[at + 4 : at + 4 + size]).partition(b"=")
        if not equals:
            return None
        fields[name] = value
        at += 4 + size
    return fields


def _next_chunk(content: memoryview, at: int) -> int:
    """Return where the next chunk begins, or the end."""
    data = content.obj if isinstance(content.obj, bytes | mmap.mmap) else bytes(content)
    field_at = at - 1
    while (field_at := data.find(CHUNK_FIELD, field_at + 1)) >= 0:
        for begin in range(max(at, field_at - CHUNK_FIELD_WITHIN), field_at):
            record = read_record(content, begin)
            if record is not None and record.op == CHUNK and CHUNK_FIELD[:-1] in record.fields:
                return begin
    return len(content)


def _u32(content: memoryview, at: int) -> int | None:
    if at < 0 or at + 4 > len(content):
        return None
    return int(struct.unpack_from("<I", content, at)[0])


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
    header = _fields(record.data) or {}
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
