"""Serialised messages -> arrays: by their fixed layout where they have one, else one after the other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.readers.ros.layouts import STRING, FieldTable, Part, read_table, source_of


class Deserialise(Protocol):
    """The deserialiser of rosbags."""

    def __call__(self, rawdata: bytes, typ: str) -> Any:  # noqa: ANN401 - a class made at run time for each type
        """Return the message."""
        ...


@dataclass(frozen=True, eq=False)
class Block:
    """Some messages of one topic.

    Attributes:
        strings: frame_id and child_frame_id of the first.
        stamp_ns: (n,) stamps of the headers.
        values: the wanted fields, (n, k) each.
    """

    strings: tuple[str, str]
    stamp_ns: IntArray
    values: dict[str, FloatArray]

    def rows(self, rows: IntArray) -> "Block":
        """Return only ``rows``, in this order."""
        return Block(self.strings, self.stamp_ns[rows], {name: value[rows] for name, value in self.values.items()})


def decode(raw: Sequence[bytes], msgtype: str, fields: Sequence[str], deserialise: Deserialise, *, cdr: bool) -> Block:
    """Return the ``fields`` of the messages, fast where their layout is fixed."""
    table = read_table(raw, msgtype, cdr=cdr)
    return block_of(table, msgtype, fields) if table is not None else decode_each(raw, msgtype, fields, deserialise)


def decode_each(raw: Sequence[bytes], msgtype: str, fields: Sequence[str], deserialise: Deserialise) -> Block:
    """Return the same with the ordinary deserialiser, message by message."""
    sources = {name: source_of(msgtype, name) for name in fields}
    stamp_ns = np.empty(len(raw), dtype=np.int64)
    whole = {part.name: np.empty((len(raw), part.count)) for part, _ in sources.values()}
    parts = {part.name: part for part, _ in sources.values()}
    strings = ("", "")
    for k, serialised in enumerate(raw):
        message = deserialise(serialised, msgtype)
        stamp_ns[k] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        for name, part in parts.items():
            whole[name][k] = _numbers(message, part)
        strings = strings if k else (message.header.frame_id, getattr(message, "child_frame_id", ""))
    return Block(strings, stamp_ns, {name: _block(whole[part.name], at) for name, (part, at) in sources.items()})


def block_of(table: FieldTable, msgtype: str, fields: Sequence[str]) -> Block:
    """Return the ``fields`` of messages of equal layout."""
    rows, values = table.rows, {}
    for name in fields:
        part, first = source_of(msgtype, name)
        whole = rows[part.name].reshape(len(rows), -1)
        values[name] = _block(whole, first).astype(np.float64)
    stamp_ns = rows["sec"].astype(np.int64) * 1_000_000_000 + rows["nanosec"]
    return Block((table.frame_id, table.child_frame_id), stamp_ns, values)


def joined_blocks(blocks: Sequence[Block]) -> Block:
    """Return blocks, at least one, as one; takes the values out of them."""
    values = {name: np.concatenate([block.values.pop(name) for block in blocks]) for name in list(blocks[0].values)}
    return Block(blocks[0].strings, np.concatenate([block.stamp_ns for block in blocks]), values)


def _block(whole: FloatArray, first: int | None) -> FloatArray:
    """Return (n, 9), the 3 x 3 block of (n, 36) that begins at row ``first``; None: the whole."""
    if first is None:
        return whole
    square = whole.reshape(len(whole), 6, 6)[:, first : first + 3, first : first + 3]
    return np.ascontiguousarray(square).reshape(len(whole), 9)


def _numbers(message: Any, part: Part) -> Any:  # noqa: ANN401 - a number, or numbers
    value = message
    for step in part.path.split("."):
        value = getattr(value, step)
    if part.code == STRING or part.count == 1 or isinstance(value, np.ndarray):
        return value
    return [getattr(value, axis) for axis in "xyzw"[: part.count]]
