"""Composes the jobs of a sweep, paying Hydra's price once for each value of each factor, not for each combination."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.config_loader import ConfigLoader
from omegaconf import DictConfig, OmegaConf

INDEPENDENT = ("filter", "adaptation", "noise", "engine", "disturbance")
"""Groups that only decide their own part of the configuration."""

REST = "rest"
"""Everything else: a data set may choose the attitude filter, an experiment anything."""

Job = Sequence[str]


@dataclass(frozen=True, eq=False)
class Composed:
    """A job's configuration.

    Attributes:
        plain: the configuration without its ``hydra`` part, as plain data; it may be shared with other jobs.
        choices: Hydra's choice for each group.
        overrides: the overrides of the job.
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]


def compose_jobs(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Job]) -> list[Composed]:
    """Compose every job: what it would be alone, but put together from parts.

    The part that belongs to a group of `INDEPENDENT` is composed once for each distinct set of overrides of this group:
    that of the first set of each group together, then that of the second, and so on.
    """
    if not _separable(jobs):
        return [_resolved(_compose(loader, config, job)) for job in jobs]
    split = [_split(job) for job in jobs]
    known: dict[tuple[str, tuple[str, ...]], Composed] = {}
    for parts in _together(split):
        composed = _compose(loader, config, [word for words in parts.values() for word in words])
        for factor, words in parts.items():
            known.setdefault((factor, words), composed)
    return [_assembled(job, parts, known) for job, parts in zip(jobs, split, strict=True)]


def _together(split: Sequence[dict[str, tuple[str, ...]]]) -> list[dict[str, tuple[str, ...]]]:
    """Return as few jobs as hold every set of overrides of every group; what is not independent, beside the first."""
    sets = {factor: list(dict.fromkeys(parts[factor] for parts in split)) for factor in split[0]}
    most = max(len(sets[group]) for group in INDEPENDENT)
    side_by_side = [
        {factor: of[k] if k < len(of) and factor != REST else of[0] for factor, of in sets.items()} for k in range(most)
    ]
    return side_by_side + [{**side_by_side[0], REST: words} for words in sets[REST][1:]]


def _assembled(
    job: Job, parts: dict[str, tuple[str, ...]], known: dict[tuple[str, tuple[str, ...]], Composed]
) -> Composed:
    """Take each group's part from the composition that knows its overrides."""
    rest = known[REST, parts[REST]]
    plain, choices = dict(rest.plain), dict(rest.choices)
    for group in INDEPENDENT:
        own = known[group, parts[group]]
        plain[group] = own.plain[group]
        choices[group] = own.choices.get(group)
    return _resolved(Composed(plain, choices, list(job)))


def _compose(loader: ConfigLoader, config: DictConfig, job: Job) -> Composed:
    composed = loader.load_sweep_config(config, list(job))
    choices: Any = OmegaConf.to_container(composed.hydra.runtime.choices)
    overrides: Any = OmegaConf.to_container(composed.hydra.overrides.task)
    plain: Any = OmegaConf.to_container(OmegaConf.masked_copy(composed, [str(k) for k in composed if k != "hydra"]))
    return Composed(plain, choices, overrides)


def _resolved(composed: Composed) -> Composed:
    """Resolve what refers to other parts; only then is OmegaConf needed, which takes longer than all the rest."""
    if "${" not in repr(composed.plain):
        return composed
    plain: Any = OmegaConf.to_container(OmegaConf.create(composed.plain), resolve=True)
    return Composed(plain, composed.choices, composed.overrides)


def _separable(jobs: Sequence[Job]) -> bool:
    """Whether no job chooses another experiment than the others, which might decide any part."""
    return len({tuple(word for word in job if _owner(word) == "experiment") for job in jobs}) == 1


def _split(job: Job) -> dict[str, tuple[str, ...]]:
    """The overrides of a job, by the group that they belong to."""
    parts: dict[str, list[str]] = {factor: [] for factor in (REST, *INDEPENDENT)}
    for word in job:
        owner = _owner(word)
        parts[owner if owner in INDEPENDENT else REST].append(word)
    return {factor: tuple(words) for factor, words in parts.items()}


def _owner(word: str) -> str:
    """The group, or the first part of the key, that an override is about."""
    return word.lstrip("+~").partition("=")[0].partition(".")[0].partition("@")[0]
