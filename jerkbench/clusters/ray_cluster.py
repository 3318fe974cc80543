"""Ray: processes of this machine, or a cluster's."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from jerkbench.clusters.cluster import ClusterError
from jerkbench.clusters.connection import Connection
from jerkbench.clusters.executing import Executing
from jerkbench.clusters.extras import required


@dataclass(frozen=True)
class Ray(Executing):
    """A Ray cluster.

    Attributes:
        address: of a cluster that runs already, "HOST:6379" or "auto"; empty: processes of this machine are started.
    """

    address: str = ""

    @contextmanager
    def connect(self, workers: int) -> Iterator[Connection]:
        """Reach the cluster, or start processes."""
        ray = required("ray", "ray")
        own = {} if self.address else {"num_cpus": workers, "include_dashboard": False}
        try:
            ray.init(address=self.address or "local", log_to_driver=False, logging_level="ERROR", **own)
        except ConnectionError as error:
            raise ClusterError(f"The Ray cluster {self.address} does not answer: {error}.") from error
        try:
            yield _RayConnection(ray, workers)
        finally:
            ray.shutdown()


class _RayConnection(Connection):
    shared_fate = False

    def __init__(self, ray: Any, workers: int) -> None:  # noqa: ANN401 - from an extra
        self._ray = ray
        super().__init__(partial(_RayExecutor, ray), workers)

    def room(self) -> int:
        """Return twice the processors of the cluster: how many bundles wait or run at once."""
        return 2 * (int(self._ray.cluster_resources().get("CPU", 0)) or self._workers)


class _RayExecutor(Executor):
    """Ray has no executor of its own; its references give futures."""

    def __init__(self, ray: Any) -> None:  # noqa: ANN401 - as above
        self._ray = ray
        self._references: dict[Future[Any], Any] = {}

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **named: Any) -> "Future[Any]":  # noqa: ANN401 - as the contract has it
        """Start ``work`` as a task of Ray; return its future."""
        # Ray itself would send it three times more; who counts the tries is the seam
        reference = self._ray.remote(work).options(num_cpus=1, max_retries=0).remote(*arguments, **named)
        future: Future[Any] = reference.future()
        self._references[future] = reference
        future.add_done_callback(lambda done: self._references.pop(done, None))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel what runs, if asked; Ray itself is left to who started it."""
        del wait
        for reference in list(self._references.values()) if cancel_futures else ():
            self._ray.cancel(reference, force=True)
