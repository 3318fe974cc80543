"""The sweeper of jerkbench. Hydra finds sweepers only in the namespace ``hydra_plugins``."""

from collections.abc import Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.types import Override
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class JerkbenchSweeper(BasicSweeper):
    """Plans and runs all jobs of a sweep together, and replaces Hydra's launcher, which runs each job separately."""

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Check the options of the sweep before Hydra creates the folder of the sweep."""
        from jerkbench.errors import PluginError
        from jerkbench.hydra_app.configuration import check_options

        if config.hydra.runtime.choices["hydra/launcher"] != "basic":
            raise PluginError("hydra/launcher= works only with hydra/sweeper=basic; give both, or cluster=NAME.")
        check_options(config)
        self.hydra_context, self.config = hydra_context, config
        self.composing = hydra_context.config_loader, config
        self.launcher = self  # type: ignore[assignment]  # Hydra only calls `launch` of the launcher

    @staticmethod
    def split_arguments(overrides: list[Override], max_batch_size: int | None) -> list[list[list[str]]]:
        """Return the combinations of a sweep. Ranges are expanded in decimal arithmetic, without rounding errors."""
        from jerkbench.hydra_app.overrides import ranges_listed

        return BasicSweeper.split_arguments(ranges_listed(overrides), max_batch_size)

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """Do nothing, because `launch` composes the jobs and reports errors."""

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[Any]:
        """Run the jobs, and return an empty sequence, because the results are stored in the folder of the study."""
        from jerkbench.hydra_app.app import launch

        launch(*self.composing, job_overrides)
        return ()
