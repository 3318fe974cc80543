"""ROS 1 bags: each chunk is followed by an index of its messages, connection by connection.

Source: the bag format 2.0, wiki.ros.org/Bags/Format/2.0.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.io.ros.cutting import Bytes, Cut, NotInBulk, as_bytes, equal_number, rows
from jerkbench.io.ros.salvage import CHUNK, INDEX, MAGIC, MESSAGE, Record, decompressed, header_fields

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
        while (record := _next(file)) is not None:
            if record.op == CHUNK:
                chunk, content = record, None
            elif record.op == INDEX and _u32(record.fields, b"conn") in topics:
                if chunk is None:
                    raise NotInBulk
                content = _content(chunk) if content is None else content
                number = _u32(record.fields, b"conn")
                yield _cut(content, np.frombuffer(record.data, dtype=ENTRY), number, topics[number])


def _next(file: BinaryIO) -> Record | None:
    size = file.read(4)
    if not size:
        return None
    fields = header_fields(memoryview(file.read(int.from_bytes(size, "little"))))
    length = int.from_bytes(file.read(4), "little")
    data = file.read(length)
    if len(fields.get(b"op", b"")) != 1 or len(data) != length:
        raise NotInBulk
    return Record(fields[b"op"][0], fields, memoryview(data), whole=True, end=file.tell())


def _content(chunk: Record) -> Bytes:
    content = as_bytes(decompressed(chunk))
    if len(content) != _u32(chunk.fields, b"size"):
        raise NotInBulk
    return content


def _cut(content: Bytes, index: np.ndarray, number: int, topic: str) -> Cut:
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
