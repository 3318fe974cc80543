"""The sweep: runs the cells that are not done yet, stores each at once, and ends with the table, whatever happens."""

import time
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from jerkbench.benchmark.cell import Cell, refusal
from jerkbench.benchmark.missing import require_inputs
from jerkbench.benchmark.pool import run_grouped
from jerkbench.benchmark.run import failed_rows, run_cell
from jerkbench.benchmark.store import Store, cell_key
from jerkbench.benchmark.tasks import Planned, Result, Task, grouped
from jerkbench.benchmark.versions import code_digest, git_commit, versions
from jerkbench.errors import PluginError
from jerkbench.report.progress import Progress


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
        RecordingError: the data of a cell are not there, or lack what its filters were asked to use.
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
        require_inputs(cell, checked)
        fingerprint = fingerprints[cell.dataset]
        key = cell_key(cell, fingerprint)
        planned.setdefault(key, Planned(cell, key, fingerprint))
    _require_names([one.cell for one in planned.values()])
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    return Plan(tuple(planned.values()), lines)


def run_sweep(plan: Plan, store: Store, workers: int, done: Collection[str]) -> None:
    """Run what is not ``done``, in ``workers`` processes, with a progress bar; store every cell as it is finished."""
    pending = [one for one in plan.cells if one.key not in done]
    finished = Finished(store)
    with Progress(len(plan.cells), already=len(plan.cells) - len(pending)) as progress:
        work = partial(run_task, store.folder.parent)
        for task, result in run_grouped(work, grouped(pending), workers, store.forget):
            if statuses := finished.add(task, result):
                progress.advance(statuses)


def run_task(folder: Path, task: Task) -> Result:
    """Run some seeds of a cell; a whole cell is stored."""
    began = time.perf_counter()
    one = task.one
    rows, notes = run_cell(one.cell, one.fingerprint, task.draws)
    seconds = time.perf_counter() - began
    if task.whole:
        Store(folder).write(one.key, rows, about(one, notes, seconds))
    return Result(rows, notes, seconds)


class Finished:
    """Cells of which some seeds are still running."""

    def __init__(self, store: Store) -> None:
        """Start with none."""
        self._store = store
        self._parts: dict[str, dict[int, Result]] = {}

    def add(self, task: Task, result: Result | Exception) -> list[str]:
        """Add what became of ``task``; store a cell with its last part, and return the status of its rows."""
        one, known = task.one, not isinstance(result, Exception)
        if isinstance(result, Exception):  # what the process could not say
            result = Result(failed_rows(one.cell, task.draws, f"{type(result).__name__}: {result}"), [], 0.0)
        parts = self._parts.setdefault(one.key, {})
        parts[task.draws.start] = result
        rows = [row for start in sorted(parts) for row in parts[start].rows]
        if len(rows) < len(one.cell.draws):
            return []
        del self._parts[one.key]
        if not (task.whole and known):
            notes = list(dict.fromkeys(note for part in parts.values() for note in part.notes))
            self._store.write(one.key, rows, about(one, notes, sum(part.seconds for part in parts.values())))
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
