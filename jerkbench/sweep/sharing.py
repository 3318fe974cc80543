"""Bundles shared with other processes: claimed before they run, left out where another has run them already."""

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence

from jerkbench.sweep.claims import Claims
from jerkbench.sweep.seed_blocks import known_runs
from jerkbench.sweep.tasks import Planned, Task
from jerkbench.sweep.writer import Writer

FOLDER = ".claims"
"""The folder of the claims, in the study's."""


def plan_name(cells: Iterable[Planned]) -> str:
    """Name a plan, whose bundles have the same numbers in every process that has it."""
    sha = hashlib.sha256()
    for planned in cells:
        sha.update(f"{planned.key} {planned.cell.draws}\n".encode())
    return sha.hexdigest()[:12]


class Shared:
    """The tasks of one round, as far as they are for this process."""

    def __init__(self, claims: Claims, writer: Writer, groups: Iterable[Sequence[Task]]) -> None:
        """Nothing is claimed yet."""
        self._claims, self._store, self._store_held = claims, writer.store, writer.flush
        self._left = Counter(task.bundle for group in groups for task in group)
        self._taken: dict[int, bool] = {}
        self._alone = True

    def admitted(self, tasks: Sequence[Task]) -> list[Task]:
        """Return those of some tasks of one bundle that are to run here."""
        bundle = tasks[0].bundle
        if bundle not in self._taken:
            self._taken[bundle] = self._claims.take(bundle)
            self._alone = self._alone and self._claims.alone()
        if not self._taken[bundle]:
            return []
        if self._alone:
            return list(tasks)
        known = known_runs([task.planned for task in tasks], self._store)
        done = [task for task in tasks if set(task.draws) <= set(known.get(task.planned.key, ()))]
        for task in done:
            self.settle(task)
        return [task for task in tasks if task not in done]

    def settle(self, task: Task) -> None:
        """Count a task as done; with the last one the bundle is anybody's again."""
        self._left[task.bundle] -= 1
        if not self._left[task.bundle]:
            self._store_held()  # before anybody else may have the bundle
            self._claims.release(task.bundle)
