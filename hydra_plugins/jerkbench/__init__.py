"""Hydra finds launchers and sweepers in the namespace ``hydra_plugins`` only; ours are thin and hand over."""

from collections.abc import Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.types import Override
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class JerkbenchLauncher(Launcher):
    """Gets all jobs of a sweep at once, and runs them as one sweep of cells."""

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Keep what is needed to compose the jobs."""
        self.config, self.hydra_context = config, hydra_context

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Run the jobs; the results are in the study's folder."""
        from jerkbench.hydra_app.app import launch

        return launch(self.hydra_context.config_loader, self.config, job_overrides)


class JerkbenchSweeper(BasicSweeper):
    """Hydra's own sweeper, which composes each job once more to see whether it can; our launcher sees that itself."""

    def __init__(self, max_batch_size: int | None = None, params: Any = None) -> None:  # noqa: ANN401 - Hydra's mapping
        """Take Hydra's own parameters."""
        super().__init__(max_batch_size, params or {})

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Check the options that are the whole sweep's, before Hydra makes its folder."""
        from jerkbench.hydra_app.configuration import check_options

        check_options(config)
        super().setup(hydra_context=hydra_context, task_function=task_function, config=config)

    @staticmethod
    def split_arguments(overrides: list[Override], max_batch_size: int | None) -> list[list[list[str]]]:
        """List the values of ranges as they were typed; refuse more combinations than can be held."""
        from jerkbench.hydra_app.overrides import ranges_listed

        return BasicSweeper.split_arguments(ranges_listed(overrides), max_batch_size)

    def get_job_batch(self) -> Sequence[Sequence[str]]:
        """Give another launcher overrides that Hydra can compose: each job has only parameters of its plugins."""
        jobs = super().get_job_batch()
        if isinstance(self.launcher, JerkbenchLauncher):
            return jobs
        from jerkbench.hydra_app.composition import compose_jobs

        assert self.hydra_context is not None  # noqa: S101 - Hydra has set it up
        assert self.config is not None  # noqa: S101
        fitted = (tuple(job.overrides) for job in compose_jobs(self.hydra_context.config_loader, self.config, jobs))
        return list(dict.fromkeys(fitted))

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """Do nothing: the jobs are composed anyway."""
