"""The composition of a sweep's jobs: Hydra's price once for each value of a factor, not for each combination."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.labels import GROUPS
from jerkbench.hydra_app.configuration import Schema

INDEPENDENT = ("filter", "adaptation", "noise", "engine", "disturbance")
"""Groups that only decide their own part of the configuration."""

REST = "rest"
"""Everything else: a data set may choose the attitude filter, an experiment anything."""

NO_GROUPS = {f.name for f in fields(Schema)} - {*GROUPS, "disturbance", "noise", "cluster"}
"""Options that are no group."""

Job = Sequence[str]
Words = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Composed:
    """A job's configuration.

    Attributes:
        plain: the configuration without its ``hydra`` part, as plain data; it may be shared with other jobs.
        choices: Hydra's choice for each group.
        overrides: the overrides of the job.
        config: the configuration as Hydra composed it.
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]
    config: DictConfig | None = None


def compose_jobs(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Job]) -> list[Composed]:
    """Compose every job: what it would be alone, but put together from parts.

    The part that belongs to a group of `INDEPENDENT` is composed once for each distinct set of choices of this group:
    that of the first set of each group together, then that of the second, and so on. Sets that differ in the values of
    parameters only take the composition of the first of them, with their own values.
    """
    if not _separable(jobs):
        return [_resolved(_compose(loader, config, job)) for job in jobs]
    split = [_split(job) for job in jobs]
    known: dict[tuple[str, Words], Composed] = {}
    for parts in _together(split):
        composed = _compose(loader, config, [word for words in parts.values() for word in words])
        for factor, words in parts.items():
            known.setdefault((factor, words), composed)
    _add_other_values(split, known)
    return [_assembled(job, parts, known) for job, parts in zip(jobs, split, strict=True)]


def _together(split: Sequence[dict[str, Words]]) -> list[dict[str, Words]]:
    """Return as few jobs as hold every set of choices of every group; what is not independent, beside the first."""
    sets = {factor: list(_firsts(parts[factor] for parts in split).values()) for factor in split[0]}
    most = max(len(sets[group]) for group in INDEPENDENT)
    side_by_side = [
        {factor: of[k] if k < len(of) and factor != REST else of[0] for factor, of in sets.items()} for k in range(most)
    ]
    return side_by_side + [{**side_by_side[0], REST: words} for words in sets[REST][1:]]


def _firsts(sets: Iterable[Words]) -> dict[Words, Words]:
    """The first of those sets of overrides that differ in values of parameters only, by what they have in common."""
    firsts: dict[Words, Words] = {}
    for words in sets:
        firsts.setdefault(_common(words), words)
    return firsts


def _common(words: Words) -> Words:
    """Return the words that decide a composition: of a parameter the key, of anything else the whole word."""
    return tuple(word.partition("=")[0] if _is_parameter(word) else word for word in words)


def _is_parameter(word: str) -> bool:
    """Whether a word only gives a value to a key that is there: no group, no mapping, nothing of Hydra's own."""
    key, _, value = word.partition("=")
    plain = key.replace(".", "").replace("_", "").isalnum() and not value.startswith("{")
    return plain and (("." in key and owner(word) != "hydra") or key in NO_GROUPS)


def _add_other_values(split: Sequence[dict[str, Words]], known: dict[tuple[str, Words], Composed]) -> None:
    """Add the sets of overrides that no composition had: that of the first like them, with their own values."""
    for factor in split[0]:
        parts = list(dict.fromkeys(parts[factor] for parts in split))
        firsts = _firsts(parts)
        varied: dict[Words, DictConfig] = {}
        for words in parts:
            if (factor, words) not in known:
                common = _common(words)
                first = known[factor, firsts[common]]
                if common not in varied:
                    varied[common] = _part_of(first, factor)
                known[factor, words] = _with_values(first, varied[common], words)


def _part_of(composed: Composed, factor: str) -> DictConfig:
    """A copy of what a factor decides of a configuration."""
    assert composed.config is not None  # noqa: S101 - Hydra has just composed it
    keys = [str(key) for key in composed.config if key != "hydra" and key not in INDEPENDENT]
    copied = OmegaConf.masked_copy(composed.config, keys if factor == REST else [factor]).copy()
    OmegaConf.set_struct(copied, True)  # noqa: FBT003 - OmegaConf's signature
    return copied


def _with_values(first: Composed, part: DictConfig, words: Words) -> Composed:
    """Set the parameters among ``words`` in ``part``, as Hydra does, over those of the set before."""
    parameters = [word for word in words if _is_parameter(word)]
    ConfigLoaderImpl._apply_overrides_to_config(OverridesParser.create().parse_overrides(parameters), part)  # noqa: SLF001 - what Hydra itself does with them
    plain: Any = OmegaConf.to_container(part)
    return Composed({**first.plain, **plain}, first.choices, first.overrides)


def _assembled(job: Job, parts: dict[str, Words], known: dict[tuple[str, Words], Composed]) -> Composed:
    """Take each group's part from the composition that knows its overrides."""
    common = known[REST, parts[REST]]
    plain, choices = dict(common.plain), dict(common.choices)
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
    return Composed(plain, choices, overrides, composed)


def _resolved(composed: Composed) -> Composed:
    """Resolve what refers to other parts; only then is OmegaConf needed, which takes longer than all the rest."""
    if "${" not in repr(composed.plain):
        return composed
    plain: Any = OmegaConf.to_container(OmegaConf.create(composed.plain), resolve=True)
    return Composed(plain, composed.choices, composed.overrides)


def _separable(jobs: Sequence[Job]) -> bool:
    """Whether no job chooses another experiment than the others, which might decide any part."""
    return len({tuple(word for word in job if owner(word) == "experiment") for job in jobs}) == 1


def _split(job: Job) -> dict[str, Words]:
    """The overrides of a job, by the group that they belong to."""
    parts: dict[str, list[str]] = {factor: [] for factor in (REST, *INDEPENDENT)}
    for word in job:
        part = owner(word)
        parts[part if part in INDEPENDENT else REST].append(word)
    return {factor: tuple(words) for factor, words in parts.items()}


def owner(word: str) -> str:
    """Return the group, or the first part of the key, that an override is about."""
    return word.lstrip("+~").partition("=")[0].partition(".")[0].partition("@")[0]
