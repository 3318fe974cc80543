"""The key of a cell: a hash of all that its rows depend on, but for their seeds."""

import hashlib
import json
from dataclasses import asdict

from jerkbench.cells.cell import Cell
from jerkbench.cells.provenance import code_digest, plugin_digest, versions
from jerkbench.contracts import ReadingFile

SEEDS = ("seeds", "first_seed")
"""Entries of a protocol that decide on which rows there are, and not on what is in them."""


def cell_key(cell: Cell, fingerprint: str) -> str:
    """Hash of all that the rows depend on besides their seeds: specification, protocol, code, libraries, data."""
    everything = {
        "labels": cell.labels,
        "spec": cell.spec,
        "protocol": {name: value for name, value in asdict(cell.protocol).items() if name not in SEEDS},
        "code": code_digest(),
        "versions": versions(),
        "plugins": plugins_digests(cell),
        "data": fingerprint,
    }
    return hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:20]


def plugins_digests(cell: Cell) -> list[str]:
    """Return a hash of the code of each plugin, and one of the files that the filter reads."""
    parts = [cell.dataset, *cell.disturbances, cell.attitude, cell.filter, cell.adaptation, cell.engine, *cell.metrics]
    read = cell.filter.fingerprint() if isinstance(cell.filter, ReadingFile) else ""
    return [*(plugin_digest(type(part)) for part in parts), read]
