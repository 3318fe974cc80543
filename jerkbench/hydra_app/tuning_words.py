"""The words behind `jerkbench tune`: the tuning's own, and those of `jerkbench run`, which may have several values."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, fields

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.errors import PluginError, unknown
from jerkbench.hydra_app.composition import owner
from jerkbench.hydra_app.typed_words import no_assignment

METHOD = ("filter", "adaptation", "noise", "engine", "r_scale")
"""Groups of which several values are several methods; several of the others are scenarios of one tuning."""


@dataclass
class TuneOptions:
    """The options of `jerkbench tune` beside those of `jerkbench run`.

    Attributes:
        trials: settings that are tried, the one before the search among them.
        sampler: sobol, tpe or cma_es.
        sampler_seed: another one is another scramble.
        objective: rmse, or likelihood (of the innovations), which needs no reference.
        split: auto (seeds, or time where nothing is random), seeds, time, recordings or families.
        share: with split=time, the share of the time to tune on.
        held_out: with split=recordings or families, names of the data sets or disturbances to test on.
        tune_seeds: number of seeds to tune on.
        choose_seeds: number of seeds to choose among the finalists on.
        test_seeds: number of seeds to test on.
        finalists: how many of the best are tried again on the seeds to choose on.
        restarts: searches; the first one counts, the others show how much is luck.
        knobs: names of the parameters to change; empty: all that have a range.
    """

    trials: int = 64
    sampler: str = "sobol"
    sampler_seed: int = 0
    objective: str = "rmse"
    split: str = "auto"
    share: float = 0.5
    held_out: list[str] = field(default_factory=list)
    tune_seeds: int = 16
    choose_seeds: int = 16
    test_seeds: int = 40
    finalists: int = 8
    restarts: int = 1
    knobs: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class TuneWords:
    """The words, told apart.

    Attributes:
        options: of the tuning.
        methods: for each method its words.
        scenarios: for each scenario its words.
        shared: the words of the scenarios as they were typed.
    """

    options: TuneOptions
    methods: tuple[tuple[str, ...], ...]
    scenarios: tuple[tuple[str, ...], ...]
    shared: tuple[str, ...]


def told_apart(words: Sequence[str], *, several: bool) -> TuneWords:
    """Tell the words apart; ``several`` methods are only taken where they are asked for (-m).

    Raises:
        PluginError: a word is no KEY=VALUE or has a wrong value, or there are several methods without -m.
    """
    names = {f.name for f in fields(TuneOptions)}
    own = [word for word in words if word.partition("=")[0] in names]
    others = [word for word in words if word not in own]
    methods = _combinations([word for word in others if owner(word) in METHOD])
    if len(methods) > 1 and not several:
        raise PluginError(f"There are {len(methods)} methods; add -m to tune each of them with the same budget.")
    shared = [word for word in others if owner(word) not in METHOD]
    return TuneWords(_options(own), methods, _combinations(shared), tuple(shared))


def _options(words: Sequence[str]) -> TuneOptions:
    try:
        merged = OmegaConf.merge(OmegaConf.structured(TuneOptions), OmegaConf.from_dotlist(list(words)))
        options: TuneOptions = OmegaConf.to_object(merged)  # type: ignore[assignment]  # it is of that class
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise PluginError(f"{error.full_key}: {reason}; `jerkbench tune --help` says what it takes.") from error
    known = ("auto", "seeds", "time", "recordings", "families")
    if options.split not in known:
        raise PluginError(unknown("split", options.split, known))
    if options.restarts < 1:
        raise PluginError(f"restarts is {options.restarts}; at least one search is needed.")
    return options


def _combinations(words: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return every combination of the values that are separated by commas."""
    return tuple(itertools.product(*map(_values, words)))


def _values(word: str) -> list[str]:
    try:
        override = OverridesParser.create().parse_override(word)
    except HydraException as error:
        raise PluginError(no_assignment(word)) from error
    if not override.is_sweep_override():
        return [word]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]
