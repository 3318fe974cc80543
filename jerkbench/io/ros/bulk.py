"""Whole topics of a bag in bulk: messages are cut out of mcap, ROS 1 and SQLite files, then decoded together."""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO, cast
from urllib.parse import quote

import apsw
import numpy as np
import numpy.typing as npt

from jerkbench.arrays import IntArray
from jerkbench.io.ros.decode import MessageBlock, decode_grid
from jerkbench.io.ros.salvage import CHUNK, INDEX, MAGIC, MESSAGE, Record, decompressed, header_fields

Bytes = npt.NDArray[np.uint8]


class NotInBulk(Exception):  # noqa: N818 - no error: the ordinary reader goes on
    """These messages cannot be cut out in bulk."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Some messages of one topic.

    Attributes:
        topic: its name.
        source: number of the connection that they came by.
        bag_ns: (n,) when each was recorded.
        grid: (n, size) their serialised bytes.
    """

    topic: str
    source: int
    bag_ns: IntArray
    grid: Bytes


def rows(buffer: Bytes, offsets: IntArray, size: int) -> Bytes:
    """Return (n, size), the bytes that begin at each of ``offsets``.

    Raises:
        NotInBulk: a row reaches out of the buffer.
    """
    if size <= 0 or len(buffer) < size or offsets.min() < 0 or offsets.max() + size > len(buffer):
        raise NotInBulk
    return np.lib.stride_tricks.sliding_window_view(buffer, size)[offsets]


def equal_number(buffer: Bytes, offsets: IntArray, dtype: str) -> int:
    """Return the number that stands at each of ``offsets``.

    Raises:
        NotInBulk: there are different ones, or they reach out of the buffer.
    """
    values = rows(buffer, offsets, np.dtype(dtype).itemsize).view(dtype)
    if (values != values[0]).any():
        raise NotInBulk
    return int(values[0, 0])


def as_bytes(content: bytes) -> Bytes:
    """Return the same bytes as an array."""
    return np.frombuffer(content, dtype=np.uint8)


# The mcap files of ROS 2: each chunk is followed by an index of its messages, channel by channel.
#
# Source: the mcap specification, mcap.dev/spec.

MCAP_MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHANNEL, MCAP_MESSAGE, MCAP_CHUNK, MCAP_INDEX, DATA_END = 2, 4, 5, 6, 7, 15
END_BYTES = 37
"""Footer and magic at the end of a file."""

HEAD_BYTES = 31
"""Of a message, before its data: kind, length, channel, running number, two times."""


def cut_mcap(path: Path, wanted: Collection[str]) -> Iterator[Cut]:
    """Yield the messages of the topics ``wanted``, chunk by chunk.

    Raises:
        NotInBulk: the file is damaged, has no index, or messages of one channel have different lengths.
    """
    with path.open("rb") as file:
        topics = {number: topic for number, topic in _channels(file) if topic in wanted}
        file.seek(len(MCAP_MAGIC))
        chunk: bytes | None = None
        content: Bytes | None = None
        while (record := _next_mcap(file)) is not None and record[0] != DATA_END:
            kind, data = record
            if kind == MCAP_CHUNK:
                chunk, content = data, None
            elif kind == MCAP_INDEX and (number := struct.unpack_from("<H", data)[0]) in topics:
                if chunk is None:
                    raise NotInBulk
                content = _mcap_content(chunk) if content is None else content
                index = np.frombuffer(data, dtype=[("time", "<u8"), ("offset", "<u8")], offset=6)
                if len(index):
                    yield _cut_of_mcap(content, index, number, topics[number])


def _channels(file: BinaryIO) -> Iterator[tuple[int, str]]:
    """Number and topic of each channel, from the summary at the end of the file."""
    file.seek(-END_BYTES, 2)
    kind, length, summary = struct.unpack("<BQQ", file.read(17))
    if (kind, length) != (FOOTER, 20) or not summary:
        raise NotInBulk
    file.seek(summary)
    while (record := _next_mcap(file)) is not None and record[0] != FOOTER:
        kind, data = record
        if kind == CHANNEL:
            number, _, size = struct.unpack_from("<HHI", data)
            yield number, data[8 : 8 + size].decode()


def _next_mcap(file: BinaryIO) -> tuple[int, bytes] | None:
    head = file.read(9)
    if len(head) < 9:
        return None
    kind, length = struct.unpack("<BQ", head)
    data = file.read(length)
    if len(data) != length:
        raise NotInBulk
    return kind, data


def _mcap_content(chunk: bytes) -> Bytes:
    """The records of a chunk, decompressed and checked."""
    size, crc, name_size = struct.unpack_from("<QII", chunk, 16)
    name = chunk[32 : 32 + name_size].decode()
    begin = 32 + name_size + 8
    (length,) = struct.unpack_from("<Q", chunk, begin - 8)
    content = _decompressed(name, chunk[begin : begin + length])
    if len(content) != size or (crc and zlib.crc32(content) != crc):
        raise NotInBulk
    return as_bytes(content)


def _decompressed(name: str, data: bytes) -> bytes:
    if name == "zstd":
        from backports import zstd

        try:
            return zstd.decompress(data)
        except zstd.ZstdError as error:
            raise NotInBulk from error
    if name == "lz4":
        from lz4.frame import decompress

        return cast("bytes", decompress(data))
    if name:
        raise NotInBulk
    return data


def _cut_of_mcap(content: Bytes, index: np.ndarray, number: int, topic: str) -> Cut:
    offsets: IntArray = index["offset"].astype(np.int64)
    heads = rows(content, offsets, HEAD_BYTES)
    length = equal_number(content, offsets + 1, "<u8")
    times = np.ascontiguousarray(heads[:, 15:23]).view("<u8")[:, 0]
    right = (heads[:, 0] == MCAP_MESSAGE) & (heads[:, 9] == number % 256) & (heads[:, 10] == number // 256)
    if not right.all() or (times != index["time"]).any():
        raise NotInBulk
    grid = rows(content, offsets + HEAD_BYTES, length - (HEAD_BYTES - 9))
    return Cut(topic, number, times.astype(np.int64), grid)


# ROS 1 bags: each chunk is followed by an index of its messages, connection by connection.
#
# Source: the bag format 2.0, wiki.ros.org/Bags/Format/2.0.

ENTRY = np.dtype([("sec", "<u4"), ("nanosec", "<u4"), ("offset", "<u4")])


def cut_ros1(path: Path, topics: Mapping[int, str]) -> Iterator[Cut]:
    """Yield the messages of the connections whose numbers are in ``topics``, chunk by chunk.

    Raises:
        NotInBulk: the bag is damaged, or messages of one connection have different lengths.
    """
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        chunk: Record | None = None
        content: Bytes | None = None
        while (record := _next_ros1(file)) is not None:
            if record.op == CHUNK:
                chunk, content = record, None
            elif record.op == INDEX and _u32(record.fields, b"conn") in topics:
                if chunk is None:
                    raise NotInBulk
                content = _ros1_content(chunk) if content is None else content
                number = _u32(record.fields, b"conn")
                yield _cut_of_ros1(content, np.frombuffer(record.data, dtype=ENTRY), number, topics[number])


def _next_ros1(file: BinaryIO) -> Record | None:
    size = file.read(4)
    if not size:
        return None
    fields = header_fields(memoryview(file.read(int.from_bytes(size, "little"))))
    length = int.from_bytes(file.read(4), "little")
    data = file.read(length)
    if len(fields.get(b"op", b"")) != 1 or len(data) != length:
        raise NotInBulk
    return Record(fields[b"op"][0], fields, memoryview(data), whole=True, end=file.tell())


def _ros1_content(chunk: Record) -> Bytes:
    content = as_bytes(decompressed(chunk))
    if len(content) != _u32(chunk.fields, b"size"):
        raise NotInBulk
    return content


def _cut_of_ros1(content: Bytes, index: np.ndarray, number: int, topic: str) -> Cut:
    """Cut the messages out, and compare each header with the index."""
    if not len(index):
        raise NotInBulk
    offsets: IntArray = index["offset"].astype(np.int64)
    head = equal_number(content, offsets, "<u4")
    size = equal_number(content, offsets + 4 + head, "<u4")
    heads = rows(content, offsets + 4, head)
    first = bytes(heads[0])
    fields, at = header_fields(memoryview(first)), first.find(b"time=") + len(b"time=")
    time = heads[:, at : at + 8]
    others = np.delete(heads, np.s_[at : at + 8], axis=1)
    stamps = np.ascontiguousarray(time).view(ENTRY["sec"].newbyteorder("<"))
    if fields.get(b"op") != bytes([MESSAGE]) or _u32(fields, b"conn") != number or len(fields.get(b"time", b"")) != 8:
        raise NotInBulk
    if (others != others[0]).any() or (stamps[:, 0] != index["sec"]).any() or (stamps[:, 1] != index["nanosec"]).any():
        raise NotInBulk
    bag_ns = index["sec"].astype(np.int64) * 1_000_000_000 + index["nanosec"]
    return Cut(topic, number, bag_ns, rows(content, offsets + 8 + head, size))


def _u32(fields: Mapping[bytes, bytes], name: bytes) -> int:
    return int.from_bytes(fields.get(name, b""), "little") if len(fields.get(name, b"")) == 4 else -1


# The SQLite files of ROS 2: a table of messages.

ROWS_AT_ONCE = 512  # more at once keep the collector of garbage busy


def cut_sqlite(path: Path, wanted: Collection[str]) -> Iterator[Cut]:
    """Yield the messages of the topics ``wanted``, some hundred at a time.

    Raises:
        NotInBulk: messages of one topic have different lengths, or the table has lost some.
        apsw.Error: the file is damaged.
    """
    _check_length(path)
    place, flags = f"file:{quote(str(path.resolve()))}?immutable=1", apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
    with closing(apsw.Connection(place, flags=flags)) as base:
        topics = {number: name for number, name in base.execute("SELECT id, name FROM topics") if name in wanted}
        places, read = ", ".join("?" * len(topics)), 0
        data = f"CASE WHEN topic_id IN ({places}) THEN data END"  # the others are only counted
        cursor = base.execute(f"SELECT topic_id, timestamp, {data} FROM messages", tuple(topics))  # noqa: S608 - only "?"
        while batch := list(islice(cursor, ROWS_AT_ONCE)):
            read += len(batch)
            for number in topics.keys() & {row[0] for row in batch}:
                yield _cut_of_sqlite([row for row in batch if row[0] == number], number, topics[number])
        if base.execute("SELECT count(*) FROM messages").fetchall() != [(read,)]:  # its index knows how many there were
            raise NotInBulk


def _check_length(path: Path) -> None:
    """A file that lost its end may be read without a complaint.

    Source: the database file format, sqlite.org/fileformat2.html: size of a page and number of pages in the header.
    """
    with path.open("rb") as file:
        header = file.read(100)
    page = int.from_bytes(header[16:18], "big")
    pages = int.from_bytes(header[28:32], "big")
    if path.stat().st_size < pages * (65536 if page == 1 else page):
        raise NotInBulk


def _cut_of_sqlite(batch: Sequence[tuple[int, int, bytes]], number: int, topic: str) -> Cut:
    _, times, messages = zip(*batch, strict=True)
    sizes = set(map(len, messages))
    if len(sizes) > 1 or 0 in sizes:
        raise NotInBulk
    return Cut(topic, number, np.array(times, dtype=np.int64), as_bytes(b"".join(messages)).reshape(len(batch), -1))


# Whole topics of a bag in bulk.

UNFIT = (
    NotInBulk,
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
    IndexError,
    TypeError,
    ImportError,  # a decompressor that rosbags no longer brings
    OverflowError,
    MemoryError,
    struct.error,
    apsw.Error,
)
"""Errors of a bag that is damaged or does not suit; the ordinary reader then finds the words."""

AT_ONCE = 4096
"""So many messages of a connection become numbers at once."""


Blocks = list[tuple[IntArray, MessageBlock]]
"""When messages were recorded (n,), and what was read of them, block by block."""


def read_in_bulk(
    files: Mapping[Path, Mapping[int, str]], types: Mapping[str, str], fields: Mapping[str, Sequence[str]]
) -> dict[str, Blocks] | None:
    """Return the ``fields`` of each topic, connection by connection; None where the ordinary reader has to do it.

    Args:
        files: each file, and, of a ROS 1 bag, its connections' numbers and topics.
        types: the type of each topic.
        fields: topics, and the fields of each that are read.
    """
    waiting: dict[tuple[str, Path, int], list[Cut]] = {}
    read: dict[tuple[str, Path, int], Blocks] = {}

    def flush(key: tuple[str, Path, int]) -> None:
        (topic, path, _), cuts = key, waiting[key]
        grid = np.concatenate([cut.grid for cut in cuts])  # a ValueError where lengths differ
        block = decode_grid(grid, types[topic], fields[topic], cdr=path.suffix != ".bag")
        if block is None:
            raise NotInBulk
        read.setdefault(key, []).append((np.concatenate([cut.bag_ns for cut in cuts]), block))
        cuts.clear()

    try:
        for path, cut in _cuts(files, fields):
            key = cut.topic, path, cut.source
            waiting.setdefault(key, []).append(cut)
            if sum(len(part.grid) for part in waiting[key]) >= AT_ONCE:
                flush(key)
        for key, cuts in waiting.items():
            if cuts:
                flush(key)
    except UNFIT:
        return None
    topics = {topic: [part for key in sorted(read) if key[0] == topic for part in read[key]] for topic in fields}
    return topics if all(topics.values()) else None


def _cuts(files: Mapping[Path, Mapping[int, str]], fields: Mapping[str, Sequence[str]]) -> Iterator[tuple[Path, Cut]]:
    for path, connections in files.items():
        if path.suffix == ".bag":
            cuts = cut_ros1(path, connections)
        else:
            cuts = (cut_mcap if path.suffix == ".mcap" else cut_sqlite)(path, fields.keys())
        yield from ((path, cut) for cut in cuts)
