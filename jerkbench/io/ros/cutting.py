"""Rows out of a buffer."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import IntArray

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
