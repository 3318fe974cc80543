"""Job queues: workers of Dask that SLURM, PBS or LSF starts, and starts again where a job is lost."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from jerkbench.jobs.cluster import ClusterError, required
from jerkbench.jobs.dask_cluster import DaskConnection, OverDask, client_of, ended, exports, quiet, sparing


@dataclass(frozen=True)
class JobQueue(OverDask):
    """Jobs of a queue, each with some worker processes; the scheduler is this process.

    Attributes:
        system: slurm, pbs or lsf.
        jobs: how many jobs are kept in the queue.
        processes: worker processes of a job, one core each.
        memory: of a job, "8GB".
        walltime: of a job, as the queue writes it: "01:00:00".
        queue: partition or queue; empty: the system's default.
        account: what is charged; empty: the system's default.
        interface: network interface by which workers reach this process, "ib0"; empty: Dask looks for one.
        directives: more lines for the head of a job's script: ["--exclusive"].
        prologue: commands of a job before its workers start: ["module load python"].
        python: the interpreter of the workers; empty: this one, at the same path.
        logs: folder of the jobs' output; empty: as the system has it.
    """

    system: str
    jobs: int = 2
    processes: int = 1
    memory: str = "4GB"
    walltime: str = "01:00:00"
    queue: str = ""
    account: str = ""
    interface: str = ""
    directives: list[str] = field(default_factory=list)
    prologue: list[str] = field(default_factory=list)
    python: str = ""
    logs: str = ""

    @contextmanager
    def connect(self, workers: int) -> Iterator[DaskConnection]:
        """Submit the jobs; work begins with the first that runs."""
        del workers  # jobs and processes say how many
        distributed = required("distributed", self.system)
        with quiet(), sparing(), ended(self._cluster()) as cluster, client_of(distributed, cluster) as client:
            cluster.adapt(minimum_jobs=self.jobs, maximum_jobs=self.jobs)  # which submits another where one is lost
            yield DaskConnection(client, self.jobs * self.processes, "of this process")

    def _cluster(self) -> Any:  # noqa: ANN401 - dask-jobqueue has no types
        jobqueue = required("dask_jobqueue", self.system)
        kind = {"slurm": jobqueue.SLURMCluster, "pbs": jobqueue.PBSCluster, "lsf": jobqueue.LSFCluster}[self.system]
        named = {
            "queue": self.queue,
            "project" if self.system == "lsf" else "account": self.account,
            "interface": self.interface,
            "python": self.python,
            "log_directory": self.logs,
        }
        try:
            return kind(
                cores=self.processes,
                processes=self.processes,
                memory=self.memory,
                walltime=self.walltime,
                job_extra_directives=self.directives,
                job_script_prologue=[*exports(), *self.prologue],
                worker_extra_args=["--no-dashboard"],
                scheduler_options={"dashboard": False},
                **{name: value for name, value in named.items() if value},
            )
        except (OSError, ValueError, RuntimeError) as error:
            raise ClusterError(f"cluster={self.system} cannot start: {error}.") from error
