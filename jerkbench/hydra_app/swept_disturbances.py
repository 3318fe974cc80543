"""Parameters of disturbances in a sweep over disturbances: each combination has those of the ones that it chooses."""

from collections.abc import Sequence

from hydra.core.config_loader import ConfigLoader
from omegaconf import DictConfig

from jerkbench.hydra_app.composition import owner

Job = Sequence[str]


def only_of_chosen(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Job]) -> list[list[str]]:
    """Leave out of each job the parameters of disturbances that only other jobs choose, and jobs that are then equal.

    A parameter of a disturbance that no job chooses stays, so that it is refused.
    """
    choices = list(dict.fromkeys(_choice(job) for job in jobs))
    if len(choices) < 2 or not any(_of(word) for job in jobs for word in job):
        return [list(job) for job in jobs]
    chosen = {choice: _names(loader, config, choice) for choice in choices}
    all_chosen = set().union(*chosen.values())
    fitting = (tuple(w for w in job if _of(w) not in all_chosen - chosen[_choice(job)]) for job in jobs)
    return [list(job) for job in dict.fromkeys(fitting)]


def _choice(job: Job) -> tuple[str, ...]:
    """The words that decide which disturbances there are."""
    return tuple(w for w in job if owner(w) in ("disturbance", "experiment") and not _of(w))


def _of(word: str) -> str:
    """The disturbance whose parameter a word gives, or an empty string."""
    key = word.lstrip("+~").partition("=")[0]
    parts = key.split(".")
    return parts[1] if parts[0] == "disturbance" and len(parts) > 1 else ""


def _names(loader: ConfigLoader, config: DictConfig, choice: Job) -> set[str]:
    return {str(name) for name in loader.load_sweep_config(config, list(choice)).disturbance or ()}
