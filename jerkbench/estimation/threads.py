"""Runs side by side in threads; compiled code does not hold Python's lock."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Run = TypeVar("Run")
Outcome = TypeVar("Outcome")


def side_by_side(work: Callable[[Run], Outcome], runs: Sequence[Run], threads: int) -> list[Outcome | None]:
    """Return ``work`` of each of ``runs``, with so many threads; None where that raised an error."""

    def guarded(run: Run) -> Outcome | None:
        """Let what one raises harm no other."""
        try:
            return work(run)
        except Exception:  # noqa: BLE001 - whoever runs it alone sees it
            return None

    if threads <= 1 or len(runs) <= 1:
        return [guarded(run) for run in runs]
    first = guarded(runs[0])  # alone: what has to be compiled is compiled once
    return [first, *_pool(threads).map(guarded, runs[1:])]


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, "jerkbench-estimators")
