"""The answer of a dry run: what would run, and for how long."""

from omegaconf import DictConfig

from jerkbench.execution.processors import processors
from jerkbench.results.store import Store
from jerkbench.sweep.forecast import forecast, lines
from jerkbench.sweep.sweep import Plan


def tell(plan: Plan, store: Store, config: DictConfig) -> None:
    """Say what would run."""
    for line in lines(forecast(plan, store), config.workers or processors()):
        print(line)
    if config.max_seeds:
        print(f"That is the first look; seeds are added up to {config.max_seeds} where a comparison is undecided.")
