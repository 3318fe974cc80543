"""The records of a ROS 1 bag, one after the other, without its index; damaged stretches are passed over.

Source: the bag format 2.0, wiki.ros.org/Bags/Format/2.0.
"""

import mmap
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

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


def header_fields(data: memoryview) -> dict[bytes, bytes]:
    """Return the fields of a connection's data; empty where they are damaged."""
    return _fields(data) or {}


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
