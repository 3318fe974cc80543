"""The composition of a sweep's jobs: Hydra's price once for each value of a factor, not for each combination."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.labels import GROUPS
from jerkbench.hydra_app.configuration import Schema
from jerkbench.hydra_app.light_composition import Composer, Composition

INDEPENDENT = ("filter", "adaptation", "noise", "engine", "disturbance")
"""Groups that only decide their own part of the configuration."""

REST = "rest"
"""Everything else: a data set may choose the attitude filter, an experiment anything."""

DATA = ("dataset", "attitude")
"""Groups of the rest that a sweep varies: a data set chooses an attitude filter, and neither decides anything else."""

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
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]


Known = dict[tuple[str, Words], Composition]
"""The composition that knows a factor's overrides."""


def compose_jobs(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Job]) -> list[Composed]:
    """Compose every job: what it would be alone, but put together from parts.

    The part that belongs to a group of `INDEPENDENT` is composed once for each distinct set of choices of this group:
    that of the first set of each group together; where another stands for itself, it takes the place of the first, and
    what is left is again composed together. Sets that differ in the values of parameters only take the composition of
    the first of them, with their own values. An experiment may decide any part: jobs of different ones share nothing.
    """
    composer = Composer(loader, config)
    composed: dict[int, Composed] = {}
    for places in _of_one_experiment(jobs):
        composed.update(zip(places, _of_parts(composer, [jobs[place] for place in places]), strict=True))
    return [composed[place] for place in range(len(jobs))]


def _of_one_experiment(jobs: Sequence[Job]) -> Iterable[list[int]]:
    """The places of the jobs that choose the same experiment."""
    groups: dict[Words, list[int]] = {}
    for place, job in enumerate(jobs):
        groups.setdefault(tuple(word for word in job if owner(word) == "experiment"), []).append(place)
    return groups.values()


def _of_parts(composer: Composer, jobs: Sequence[Job]) -> list[Composed]:
    """Compose jobs of one experiment."""
    split = [_split(job) for job in jobs]
    known = _exchanged(composer, split)
    for parts in _together(split, known):
        composed = composer.compose([word for words in parts.values() for word in words])
        for factor, words in parts.items():
            known.setdefault((factor, words), composed)
    _add_other_values(split, known)
    return [_assembled(job, parts, known) for job, parts in zip(jobs, split, strict=True)]


def _exchanged(composer: Composer, split: Sequence[dict[str, Words]]) -> Known:
    """Compose the first sets of choices together, and put those that stand for themselves in their places."""
    sets = {factor: list(_firsts(parts[factor] for parts in split).values()) for factor in split[0]}
    first = composer.compose([word for of in sets.values() for word in of[0]])
    known = {(factor, of[0]): first for factor, of in sets.items()}
    for group in INDEPENDENT:
        for words in sets[group][1:]:
            if composition := composer.exchanged(first, group, words):
                known[group, words] = composition
    return known | _other_data(composer, first, sets[REST])


def _other_data(composer: Composer, first: Composition, sets: Sequence[Words]) -> Known:
    """Put other data sets, with their attitude filters, in the place of the first's, where they decide nothing else."""
    alike = [words for words in sets if _without_data(words) == _without_data(sets[0])]
    composed = {words: composer.of_groups((*DATA, "experiment"), _of_data(words)) for words in alike if len(alike) > 1}
    own = composed.get(sets[0])
    return {
        (REST, words): _in_place(first, other)
        for words, other in composed.items()
        if own and other and words != sets[0] and _beyond_data(other) == _beyond_data(own)
    }


def _in_place(first: Composition, other: Composition) -> Composition:
    """Put other data into a composition."""
    plain = {**first.plain, **{group: other.plain[group] for group in DATA}}
    OmegaConf.set_struct(other.config, False)  # noqa: FBT003 - OmegaConf's signature
    for key in _beyond_data(other):
        del other.config[key]
    return replace(other, plain=plain, choices={**first.choices, **other.choices}, beside=first)


def _of_data(words: Words) -> Words:
    return tuple(word for word in words if owner(word) in (*DATA, "experiment"))


def _without_data(words: Words) -> Words:
    return tuple(word for word in words if owner(word) not in DATA)


def _beyond_data(composition: Composition) -> dict[str, Any]:
    """What a composition of data sets says of anything else."""
    return {key: value for key, value in composition.plain.items() if key not in DATA}


def _together(split: Sequence[dict[str, Words]], known: Known) -> list[dict[str, Words]]:
    """Return as few jobs as hold every set that is not ``known``; what is not independent, beside the first."""
    sets = {factor: list(_firsts(parts[factor] for parts in split).values()) for factor in split[0]}
    unknown = {factor: [words for words in of if (factor, words) not in known] for factor, of in sets.items()}
    most = max(len(unknown[group]) for group in INDEPENDENT)
    side_by_side = [
        {
            factor: unknown[factor][k] if factor != REST and k < len(unknown[factor]) else of[0]
            for factor, of in sets.items()
        }
        for k in range(most)
    ]
    beside = {factor: of[0] for factor, of in sets.items()}
    return side_by_side + [{**beside, REST: words} for words in unknown[REST]]


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


def _add_other_values(split: Sequence[dict[str, Words]], known: Known) -> None:
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


def _part_of(composed: Composition, factor: str) -> DictConfig:
    """A copy of what a factor decides of a configuration."""
    keys = [key for key in composed.plain if key not in INDEPENDENT]
    copied = composed.part(keys if factor == REST else [factor])
    OmegaConf.set_struct(copied, True)  # noqa: FBT003 - OmegaConf's signature
    return copied


def _with_values(first: Composition, part: DictConfig, words: Words) -> Composition:
    """Set the parameters among ``words`` in ``part``, as Hydra does, over those of the set before."""
    parameters = [word for word in words if _is_parameter(word)]
    ConfigLoaderImpl._apply_overrides_to_config(OverridesParser.create().parse_overrides(parameters), part)  # noqa: SLF001 - what Hydra itself does with them
    plain: Any = OmegaConf.to_container(part)
    return replace(first, plain=plain)


def _assembled(job: Job, parts: dict[str, Words], known: Known) -> Composed:
    """Take each group's part from the composition that knows its overrides."""
    common = known[REST, parts[REST]]
    plain, choices = dict(common.plain), dict(common.choices)
    for group in INDEPENDENT:
        own = known[group, parts[group]]
        plain[group] = own.plain[group]
        choices[group] = own.choices.get(group)
    return _resolved(Composed(plain, choices, list(job)))


def _resolved(composed: Composed) -> Composed:
    """Resolve what refers to other parts; only then is OmegaConf needed, which takes longer than all the rest."""
    if "${" not in repr(composed.plain):
        return composed
    plain: Any = OmegaConf.to_container(OmegaConf.create(composed.plain), resolve=True)
    return Composed(plain, composed.choices, composed.overrides)


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
