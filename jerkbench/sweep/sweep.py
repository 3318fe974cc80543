"""The sweep: runs the cells that are not done yet, stores each at once, and ends with the table, whatever happens."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from jerkbench.cells.cell import Cell, refusal
from jerkbench.cells.data import data_fingerprint
from jerkbench.errors import PluginError
from jerkbench.execution.cell_run import CellRun, failed_rows
from jerkbench.execution.pool import run_grouped
from jerkbench.execution.preflight import require_inputs
from jerkbench.execution.progress import Progress
from jerkbench.results.store import Store, cell_key
from jerkbench.sweep.seed_blocks import Blocks, missing, run_blocks, store_cell
from jerkbench.sweep.tasks import Planned, Result, Task, grouped


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a sweep.

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
        source = cell.dataset, cell.disturbances
        if source not in fingerprints:
            fingerprints[source] = data_fingerprint(*source)
        require_inputs(cell, checked)
        fingerprint = fingerprints[source]
        key = cell_key(cell, fingerprint)
        planned.setdefault(key, Planned(cell, key, fingerprint))
    _require_names([entry.cell for entry in planned.values()])
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    return Plan(tuple(planned.values()), lines)


def run_sweep(plan: Plan, store: Store, workers: int, done: Collection[str]) -> None:
    """Run what is not ``done``, in ``workers`` processes, with a progress bar; store every cell as it is finished.

    Of a cell that was begun before, only the seeds that are missing run.
    """
    pending = [planned for planned in plan.cells if planned.key not in done]
    finished = Finished(store)
    with Progress(len(plan.cells), already=len(plan.cells) - len(pending)) as progress:
        remaining = {}
        for planned in pending:
            remaining[planned.key] = finished.resume(planned)
            if not remaining[planned.key]:
                progress.advance(finished.conclude(planned))
        work = partial(run_task, store.folder.parent)
        for task, result in run_grouped(work, grouped(pending, remaining), workers, store.forget):
            if statuses := finished.add(task, result):
                progress.advance(statuses)


def run_task(folder: Path, task: Task) -> Result:
    """Run some seeds of a cell, and store them; those of a whole cell as the cell."""
    planned, store = task.planned, Store(folder)
    pieces = CellRun(planned.cell, planned.fingerprint).pieces(task.draws)
    result = run_blocks(planned, pieces, Blocks(store), keep_rest=not task.complete)
    if task.complete:
        store_cell(planned, [result], store)
    return result


class Finished:
    """Cells of which some seeds are still running."""

    def __init__(self, store: Store) -> None:
        """Start with none."""
        self._store = store
        self._parts: dict[str, list[Result]] = {}

    def resume(self, planned: Planned) -> Sequence[int]:
        """Take up the stored seeds of a cell; returns those that are missing."""
        known = Blocks(self._store).read(planned)
        self._parts[planned.key] = [known]
        return missing(planned, known)

    def add(self, task: Task, result: Result | Exception) -> list[str]:
        """Add what became of ``task``; store a cell with its last part, and return the status of its rows."""
        planned, known = task.planned, not isinstance(result, Exception)
        if isinstance(result, Exception):  # what the process could not say
            result = Result(failed_rows(planned.cell, task.draws, f"{type(result).__name__}: {result}"), [], 0.0)
        parts = self._parts.setdefault(planned.key, [])
        parts.append(result)
        if sum(len(part.rows) for part in parts) < len(planned.cell.draws):
            return []
        if not (task.complete and known):
            return self.conclude(planned)
        return [row["status"] for part in self._parts.pop(planned.key) for row in part.rows]

    def conclude(self, planned: Planned) -> list[str]:
        """Store a cell of which no seed is missing; returns the status of its rows."""
        return [row["status"] for row in store_cell(planned, self._parts.pop(planned.key), self._store)]


def _require_names(cells: Sequence[Cell]) -> None:
    """Refuse two cells that no column of the table would tell apart."""
    cells_by_name: dict[object, Cell] = {}
    for cell in cells:
        namesake = cells_by_name.setdefault(cell.labels, cell)
        if namesake is not cell:
            parts = [part for part in cell.spec if cell.spec[part] != namesake.spec[part]]
            raise PluginError(
                f"Two combinations would both be called {', '.join(cell.labels)}: they differ in {' and '.join(parts)} "
                "in a way that no column shows; run them into studies of their own (study=NAME)."
            )
