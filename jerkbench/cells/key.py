"""The key of a cell: a hash of all that its rows depend on."""

import hashlib
import json
from collections.abc import Collection
from dataclasses import asdict

from jerkbench.cells.cell import Cell
from jerkbench.cells.provenance import code_digest, plugin_digest, versions
from jerkbench.contracts import ReadingFile


def cell_key(cell: Cell, fingerprint: str) -> str:
    """Hash of all that the cell's rows depend on: specification, protocol, our code, the plugins', libraries, data."""
    return _hashed(cell, fingerprint, ("seeds", "first_seed") if not cell.seeded else ())


def cell_identity(cell: Cell, fingerprint: str) -> str:
    """Hash of the same without the seeds: rows of one identity and other seeds belong together."""
    return _hashed(cell, fingerprint, ("seeds", "first_seed"))


def plugins_digests(cell: Cell) -> list[str]:
    """Return a hash of the code of each plugin, and one of the files that the filter reads."""
    parts = [cell.dataset, *cell.disturbances, cell.attitude, cell.filter, cell.adaptation, cell.engine, *cell.metrics]
    read = cell.filter.fingerprint() if isinstance(cell.filter, ReadingFile) else ""
    return [*(plugin_digest(type(part)) for part in parts), read]


def _hashed(cell: Cell, fingerprint: str, not_deciding: Collection[str]) -> str:
    everything = {
        "labels": cell.labels,
        "spec": cell.spec,
        "protocol": {name: value for name, value in asdict(cell.protocol).items() if name not in not_deciding},
        "code": code_digest(),
        "versions": versions(),
        "plugins": plugins_digests(cell),
        "data": fingerprint,
    }
    return hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:20]
