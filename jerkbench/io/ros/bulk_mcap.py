"""The mcap files of ROS 2: each chunk is followed by an index of its messages, channel by channel.

Source: the mcap specification, mcap.dev/spec.
"""

import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.io.ros.cutting import Bytes, Cut, NotInBulk, as_bytes, equal_number, rows

MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHANNEL, MESSAGE, CHUNK, INDEX, DATA_END = 2, 4, 5, 6, 7, 15
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
        file.seek(len(MAGIC))
        chunk: bytes | None = None
        content: Bytes | None = None
        while (record := _next(file)) is not None and record[0] != DATA_END:
            kind, data = record
            if kind == CHUNK:
                chunk, content = data, None
            elif kind == INDEX and (number := struct.unpack_from("<H", data)[0]) in topics:
                if chunk is None:
                    raise NotInBulk
                content = _content(chunk) if content is None else content
                index = np.frombuffer(data, dtype=[("time", "<u8"), ("offset", "<u8")], offset=6)
                if len(index):
                    yield _cut(content, index, number, topics[number])


def _channels(file: BinaryIO) -> Iterator[tuple[int, str]]:
    """Number and topic of each channel, from the summary at the end of the file."""
    file.seek(-END_BYTES, 2)
    kind, length, summary = struct.unpack("<BQQ", file.read(17))
    if (kind, length) != (FOOTER, 20) or not summary:
        raise NotInBulk
    file.seek(summary)
    while (record := _next(file)) is not None and record[0] != FOOTER:
        kind, data = record
        if kind == CHANNEL:
            number, _, size = struct.unpack_from("<HHI", data)
            yield number, data[8 : 8 + size].decode()


def _next(file: BinaryIO) -> tuple[int, bytes] | None:
    head = file.read(9)
    if len(head) < 9:
        return None
    kind, length = struct.unpack("<BQ", head)
    data = file.read(length)
    if len(data) != length:
        raise NotInBulk
    return kind, data


def _content(chunk: bytes) -> Bytes:
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


def _cut(content: Bytes, index: np.ndarray, number: int, topic: str) -> Cut:
    offsets: IntArray = index["offset"].astype(np.int64)
    heads = rows(content, offsets, HEAD_BYTES)
    length = equal_number(content, offsets + 1, "<u8")
    times = np.ascontiguousarray(heads[:, 15:23]).view("<u8")[:, 0]
    right = (heads[:, 0] == MESSAGE) & (heads[:, 9] == number % 256) & (heads[:, 10] == number // 256)
    if not right.all() or (times != index["time"]).any():
        raise NotInBulk
    grid = rows(content, offsets + HEAD_BYTES, length - (HEAD_BYTES - 9))
    return Cut(topic, number, times.astype(np.int64), grid)
