"""A fresh, indexed bag from the intact part of a ROS 1 bag that was cut off or damaged.

Source: the bag format 2.0, wiki.ros.org/Bags/Format/2.0.
"""

import mmap
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from jerkbench.files import write_atomically
from jerkbench.io.bag import BagError, bag_errors, first_bytes

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Writer
    from rosbags.rosbag1.reader import Header


# The records of a ROS 1 bag, one after the other, without its index; damaged stretches are passed
# over.

_MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = 2, 5, 7
_LONGEST_HEADER = 64 * 1024
"""No record has a longer header (a connection's has a topic in it)."""

LARGEST_CHUNK = 1 << 31
CHUNK_FIELD = b"compression="
"""Only a chunk's header has this field, in the first `CHUNK_FIELD_WITHIN` bytes: where reading can begin again."""
CHUNK_FIELD_WITHIN = 80

BagBytes = bytes | mmap.mmap


class Record(NamedTuple):
    """A record.

    Attributes:
        op: what it is: `MESSAGE`, `CHUNK`, `CONNECTION` or something of the index.
        header: its fields.
        data: what follows the header; shorter than promised where the file ends.
        whole: whether all of it is there.
        end: where the next one begins.
    """

    op: int
    header: "Header"
    data: bytes
    whole: bool
    end: int


def read_record(content: BagBytes, at: int) -> Record | None:
    """Return the record that begins at ``at``, or None where none begins."""
    from rosbags.rosbag1.reader import Header, ReaderError

    begin = at + 4 + int.from_bytes(content[at : at + 4], "little")
    size = int.from_bytes(content[begin : begin + 4], "little")
    if not at + 4 < begin <= at + 4 + _LONGEST_HEADER or begin + 4 > len(content) or size > LARGEST_CHUNK:
        return None
    try:
        header = Header.read(BytesIO(content[at:begin]))
        op = header.get_uint8("op")
    except (ReaderError, UnicodeDecodeError):
        return None
    end = begin + 4 + size
    return Record(op, header, content[begin + 4 : end], end <= len(content), end)


def chunks(content: BagBytes) -> Iterator[Record | int]:
    """Yield each chunk of a bag's bytes, and, for each damaged stretch, how many bytes were passed over."""
    at = len(_MAGIC)
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
    content, at = decompressed(chunk), 0
    while (record := read_record(content, at)) is not None and record.whole:
        if record.op in (MESSAGE, CONNECTION):
            yield record
        at = record.end


def decompressed(chunk: Record) -> bytes:
    """Return all that can be decompressed, of a chunk that was cut too; nothing where it is damaged."""
    from bz2 import BZ2Decompressor

    from lz4.frame import LZ4FrameDecompressor

    name = chunk.header.get("compression", b"")
    try:
        if name in (b"bz2", b"lz4"):
            return bytes((BZ2Decompressor if name == b"bz2" else LZ4FrameDecompressor)().decompress(chunk.data))
    except (OSError, RuntimeError, EOFError, ValueError, MemoryError):  # what bz2 and lz4 raise on damage
        return b""
    return chunk.data if name == b"none" else b""


def _next_chunk(content: BagBytes, at: int) -> int:
    """Return where the next chunk begins, or the end."""
    field_at = at - 1
    while (field_at := content.find(CHUNK_FIELD, field_at + 1)) >= 0:
        for begin in range(max(at, field_at - CHUNK_FIELD_WITHIN), field_at):
            record = read_record(content, begin)
            if record is not None and record.op == CHUNK and "compression" in record.header:
                return begin
    return len(content)


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


def _content(source: Path) -> BagBytes:
    """The file's bytes, read by the system as they are needed: a bag may be larger than the memory."""
    if not first_bytes(source).startswith(_MAGIC[:8]):
        raise BagError(
            f"{source} is no ROS 1 bag by its first bytes; only those can be salvaged. `mcap recover` and SQLite's"
            " `.recover` do it for the others."
        )
    with source.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _write(content: BagBytes, target: Path, saved: Salvaged, source: Path) -> None:
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
        size, number = record.end, record.header.get("conn", b"")
        if record.op != MESSAGE:
            if number not in connections:
                _connect(record, number, writer, connections)
        elif number in connections and len(record.header.get("time", b"")) == 8:
            connection = connections[number]
            writer.write(connection, record.header.get_time("time"), record.data)
            saved.messages[connection.topic] = saved.messages.get(connection.topic, 0) + 1
    saved.chunks += size > 0
    saved.cut_chunks += not chunk.whole or size != int.from_bytes(chunk.header.get("size", b""), "little")


def _connect(record: Record, number: bytes, writer: "Writer", connections: "dict[bytes, Connection]") -> None:
    from rosbags.rosbag1.reader import Header, ReaderError

    try:
        header = Header.read(BytesIO(len(record.data).to_bytes(4, "little") + record.data))
    except (ReaderError, UnicodeDecodeError):
        return
    fields = {name: value.decode(errors="replace") for name, value in {**header, **record.header}.items()}
    topic, name, md5 = (fields.get(key, "") for key in ("topic", "type", "md5sum"))
    if topic and name.count("/") == 1 and md5:
        known = {(c.topic, c.msgtype, c.digest): c for c in connections.values()}
        msgtype, definition = name.replace("/", "/msg/"), fields.get("message_definition", "")
        connections[number] = known.get((topic, msgtype, md5)) or writer.add_connection(
            topic, msgtype, msgdef=definition, md5sum=md5, callerid=fields.get("callerid")
        )
