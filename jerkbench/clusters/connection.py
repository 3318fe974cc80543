"""The connection to an engine: an executor that takes bundles, and what one has to know of it."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

Answer = TypeVar("Answer")


class Connection:
    """Any `concurrent.futures.Executor`, opened.

    An engine overrides what it can say better.

    Attributes:
        shared_fate: whether all that runs is lost with one worker.
    """

    shared_fate = True

    def __init__(self, executor: Callable[[], Executor], workers: int) -> None:
        """Take the maker of the executor, which is asked for another one where the last broke, and its workers."""
        self._make, self._workers = executor, workers
        self.executor = executor()

    def submit(self, work: Callable[..., Answer], *arguments: Any) -> "Future[Answer]":  # noqa: ANN401 - goes to the work
        """Hand over a piece of work."""
        return self.executor.submit(work, *arguments)

    def room(self) -> int:
        """Return how many bundles may be on their way: one that runs and one that waits for each worker."""
        return 2 * self._workers

    def trouble(self) -> str:
        """Return why no result will come any more, or an empty string."""
        return ""

    def renew(self) -> None:
        """Take another executor; the last is broken."""
        self.close()
        self.executor = self._make()

    def close(self) -> None:
        """Cancel what waits, and end the executor; what runs is not wanted any more."""
        self.executor.shutdown(wait=False, cancel_futures=True)
