"""The sweep: runs the cells that are not done yet, stores each at once, and ends with the table, whatever happens."""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from jerkbench.benchmark.cell import Cell, refusal
from jerkbench.benchmark.missing import require_inputs
from jerkbench.benchmark.pool import run_grouped
from jerkbench.benchmark.run import failed_rows, run_cell
from jerkbench.benchmark.store import Store, cell_key
from jerkbench.benchmark.versions import code_digest, git_commit, versions
from jerkbench.errors import PluginError
from jerkbench.report.progress import Progress


@dataclass(frozen=True, eq=False)
class Planned:
    """A cell with its key and what is known of its data."""

    cell: Cell
    key: str
    fingerprint: str


@dataclass(frozen=True, eq=False)
class Plan:
    """What a sweep is going to do.

    Attributes:
        cells: every cell, in order.
        refused: sentences about the combinations that make no sense and are left out.
    """

    cells: tuple[Planned, ...]
    refused: tuple[str, ...]


def plan_sweep(cells: Sequence[Cell]) -> Plan:
    """Find the key of each cell; leave out what is refused and what is there twice.

    Raises:
        RecordingError: the data of a cell are not there, or lack what its attitude filter was asked to use.
        PluginError: two cells would have the same name in the table.
    """
    planned: dict[str, Planned] = {}
    refused: dict[str, int] = {}
    fingerprints: dict[object, str] = {}
    checked: set[tuple[object, object]] = set()
    for cell in cells:
        if reason := refusal(cell):
            refused[reason] = refused.get(reason, 0) + 1
            continue
        if cell.dataset not in fingerprints:
            fingerprints[cell.dataset] = cell.dataset.fingerprint()
        if (cell.dataset, cell.attitude) not in checked:
            require_inputs(cell)
            checked.add((cell.dataset, cell.attitude))
        fingerprint = fingerprints[cell.dataset]
        key = cell_key(cell, fingerprint)
        planned.setdefault(key, Planned(cell, key, fingerprint))
    _require_names([one.cell for one in planned.values()])
    lines = tuple(f"Left out {count} combinations: {reason}." for reason, count in refused.items())
    return Plan(tuple(planned.values()), lines)


def run_sweep(plan: Plan, store: Store, workers: int) -> None:
    """Run what is not done yet, in ``workers`` processes, with a progress bar; store every cell as it is finished."""
    pending = [one for one in plan.cells if not store.done(one.key)]
    with Progress(len(plan.cells), already=len(plan.cells) - len(pending)) as progress:
        work = partial(run_and_store, store.folder.parent)
        for one, statuses in run_grouped(work, _grouped(pending), workers):
            if isinstance(statuses, Exception):
                rows = failed_rows(one.cell, f"{type(statuses).__name__}: {statuses}")
                store.write(one.key, rows, about(one, notes=[], seconds=0.0))
                statuses = [row["status"] for row in rows]  # noqa: PLW2901 - what the process could not say
            progress.advance(statuses)


def run_and_store(folder: Path, one: Planned) -> list[str]:
    """Run one cell and store it; returns the status of each of its rows."""
    began = time.perf_counter()
    rows, notes = run_cell(one.cell, one.fingerprint)
    Store(folder).write(one.key, rows, about(one, notes, time.perf_counter() - began))
    return [row["status"] for row in rows]


def about(one: Planned, notes: list[str], seconds: float) -> dict[str, object]:
    """What is stored beside the rows of a cell."""
    cell = one.cell
    return {
        "labels": cell.labels._asdict(),
        "spec": cell.spec,
        "protocol": asdict(cell.protocol),
        "data": one.fingerprint,
        "notes": notes,
        "code": code_digest(),
        "versions": versions(),
        "commit": git_commit(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(seconds, 3),
    }


def _require_names(cells: Sequence[Cell]) -> None:
    """Refuse two cells that no column of the table would tell apart."""
    seen: dict[object, Cell] = {}
    for cell in cells:
        other = seen.setdefault(cell.labels, cell)
        if other is not cell:
            parts = [part for part in cell.spec if cell.spec[part] != other.spec[part]]
            raise PluginError(
                f"Two combinations would both be called {', '.join(cell.labels)}: they differ in {' and '.join(parts)} "
                "in a way that no column shows; run them into studies of their own (study=NAME)."
            )


def _grouped(pending: Sequence[Planned]) -> list[list[Planned]]:
    """Cells that share their recording and attitude, together."""
    groups: dict[object, list[Planned]] = {}
    for one in pending:
        cell = one.cell
        groups.setdefault((cell.dataset, cell.disturbances, cell.attitude, one.fingerprint), []).append(one)
    return list(groups.values())
