"""Whole topics of a bag in bulk."""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import apsw
import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.io.ros.bulk_mcap import cut_mcap
from jerkbench.io.ros.bulk_ros1 import cut_ros1
from jerkbench.io.ros.bulk_sqlite import cut_sqlite
from jerkbench.io.ros.cutting import Bytes, Cut, NotInBulk
from jerkbench.io.ros.decode import Block, block_of, field_table, joined_blocks

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


@dataclass(frozen=True, eq=False)
class TopicMessages:
    """All messages of a topic.

    Attributes:
        bag_ns: (n,) when each was recorded, in this order.
        block: what was read of them.
    """

    bag_ns: IntArray
    block: Block


@dataclass
class _Waiting:
    """Messages of a connection, cut out and not yet read, and what was read before."""

    bag_ns: list[IntArray] = field(default_factory=list)
    grids: list[Bytes] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)


def read_in_bulk(
    files: Mapping[Path, Mapping[int, str]], types: Mapping[str, str], fields: Mapping[str, Sequence[str]]
) -> dict[str, TopicMessages] | None:
    """Return the ``fields`` of each topic, or None where the ordinary reader has to do it.

    Args:
        files: each file, and, of a ROS 1 bag, its connections' numbers and topics.
        types: the type of each topic.
        fields: topics, and the fields of each that are read.
    """
    waiting: dict[tuple[str, Path, int], _Waiting] = {}
    try:
        for path, cut in _cuts(files, fields):
            pending = waiting.setdefault((cut.topic, path, cut.source), _Waiting())
            pending.bag_ns.append(cut.bag_ns)
            pending.grids.append(cut.grid)
            if sum(len(grid) for grid in pending.grids) >= AT_ONCE:
                _read(pending, types[cut.topic], fields[cut.topic], cdr=path.suffix != ".bag")
        for (topic, path, _), pending in waiting.items():
            _read(pending, types[topic], fields[topic], cdr=path.suffix != ".bag")
    except UNFIT:
        return None
    topics = {topic: [waiting[key] for key in sorted(waiting) if key[0] == topic] for topic in fields}
    return {topic: _joined(connections) for topic, connections in topics.items()} if all(topics.values()) else None


def _cuts(files: Mapping[Path, Mapping[int, str]], fields: Mapping[str, Sequence[str]]) -> Iterator[tuple[Path, Cut]]:
    for path, connections in files.items():
        if path.suffix == ".bag":
            cuts = cut_ros1(path, connections)
        else:
            cuts = (cut_mcap if path.suffix == ".mcap" else cut_sqlite)(path, fields.keys())
        yield from ((path, cut) for cut in cuts)


def _read(pending: _Waiting, msgtype: str, fields: Sequence[str], *, cdr: bool) -> None:
    if not pending.grids:
        return
    if len({grid.shape[1] for grid in pending.grids}) > 1:
        raise NotInBulk
    table = field_table(np.concatenate(pending.grids), msgtype, cdr=cdr)
    if table is None:
        raise NotInBulk
    pending.blocks.append(block_of(table, msgtype, fields))
    pending.grids.clear()


def _joined(connections: Sequence[_Waiting]) -> TopicMessages:
    bag_ns = np.concatenate([part for pending in connections for part in pending.bag_ns])
    block = joined_blocks([block for pending in connections for block in pending.blocks])
    if (np.diff(bag_ns) < 0).any():
        order = np.argsort(bag_ns, kind="stable")
        bag_ns, block = bag_ns[order], block.rows(order)
    return TopicMessages(bag_ns, block)
