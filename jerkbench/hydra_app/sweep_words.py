"""The words of a sweep: ranges as they were typed, a limit of combinations, and parameters for some of its plugins.

A parameter under the name of its plugin (``adaptation.mtf.window=1,4``, ``disturbance.bias.accel_mps2=1``) applies
where that plugin is chosen.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any, NamedTuple

from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, RangeSweep, ValueType
from omegaconf import DictConfig

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.hydra_app.composition import Composed, JobWords, compose_jobs, owner
from jerkbench.jobs.labels import GROUPS
from jerkbench.presets import default_names, preset_names

MOST_COMBINATIONS = 100_000
"""Combinations of one sweep."""


def ranges_listed(overrides: Sequence[Override]) -> list[Override]:
    """Return the overrides with each range as the list of its values.

    Hydra adds binary fractions (.1 + .1 + .1 is .30000000000000004, and .4 comes after it, although a range ends before
    its stop); here the decimals are added that were typed.

    Raises:
        PluginError: a range has no end or no values, or there are more combinations than `MOST_COMBINATIONS`.
    """
    last = {override.get_key_element(): override for override in overrides}  # a key that is given twice has its last
    count = math.prod(_count(override) for override in last.values())
    if count > MOST_COMBINATIONS:
        raise PluginError(
            f"The sweep has {count:,} combinations; {MOST_COMBINATIONS:,} are the most of one sweep: give fewer"
            " values, or split it."
        )
    return [_listed(override) for override in overrides]


def ignored_combinations(params: Mapping[str, Any] | None, words: Sequence[str]) -> int:
    """Return how many combinations of a sweep that an experiment defines a single run leaves out.

    Args:
        params: the parameters of the sweeper: values by key.
        words: the overrides of the run, which replace them.
    """
    given = {word.partition("=")[0] for word in words}
    swept = [f"{key}={value}" for key, value in (params or {}).items() if key not in given]
    return math.prod(map(_count, OverridesParser.create().parse_overrides(swept))) - 1


def _count(override: Override) -> int:
    if isinstance(override.value(), RangeSweep):
        return _decimals(override)[2]
    return len(list(override.sweep_iterator())) if override.is_discrete_sweep() else 1


def _listed(override: Override) -> Override:
    value = override.value()
    if not isinstance(value, RangeSweep):
        return override
    start, step, count = _decimals(override)
    kind = int if all(isinstance(number, int) for number in (value.start, value.stop, value.step)) else float
    numbers: list[Any] = [kind(start + k * step) for k in range(count)]
    choices = ChoiceSweep(tags=value.tags, list=numbers, shuffle=value.shuffle)
    return replace(override, value_type=ValueType.CHOICE_SWEEP, _value=choices)


def _decimals(override: Override) -> tuple[Decimal, Decimal, int]:
    """Start and step of a range as they were typed, and how many values it has."""
    values: Any = override.value()
    typed = override.input_line
    start, stop, step = (Decimal(str(number)) for number in (values.start, values.stop, values.step))
    if not (start.is_finite() and stop.is_finite() and step.is_finite() and step):
        raise PluginError(f"{typed}: start, stop and step of a range are finite numbers, the step not 0.")
    count = math.ceil((stop - start) / step)
    if count < 1:
        raise PluginError(f"{typed} has no values: a range goes from its start to before its stop.")
    return start, step, count


class Address(NamedTuple):
    """What a word is about: ``GROUP.NAME.PARAMETER=VALUE``.

    Attributes:
        group: of the plugin.
        name: of the plugin, or of a preset.
        plain: the word as Hydra takes it: without the name, but for a disturbance.
    """

    group: str
    name: str
    plain: str


def where_chosen(loader: ConfigLoader, config: DictConfig, jobs: Sequence[JobWords]) -> list[list[str]]:
    """Give addressed parameters to the jobs that choose their plugin; jobs that are then equal are one.

    A parameter of a disturbance that no job chooses stays, so that Hydra refuses it.

    Raises:
        PluginError: no job chooses the plugin of another address.
    """
    addresses = {word: to for job in jobs for word in job if (to := address(word) or _of_disturbance(word))}
    if not addresses:
        return [list(job) for job in jobs]
    groups = sorted({to.group for to in addresses.values()})
    choices = dict.fromkeys(_choice(job, group) for group in groups for job in jobs)
    composed = dict(zip(choices, compose_jobs(loader, config, list(choices)), strict=True))
    chosen = {group: [_names(composed[_choice(job, group)], group) for job in jobs] for group in groups}
    anywhere = {group: set[str]().union(*names) for group, names in chosen.items()}
    for to in addresses.values():
        if to.group != "disturbance" and to.name not in anywhere[to.group]:
            raise PluginError(_nowhere(to))

    def fitting(place: int, word: str) -> bool:
        to = addresses.get(word)
        return to is None or to.name in chosen[to.group][place] or to.name not in anywhere[to.group]

    fitted = (
        tuple(addresses[word].plain if word in addresses else word for word in job if fitting(place, word))
        for place, job in enumerate(jobs)
    )
    return [list(job) for job in dict.fromkeys(fitted)]


def swept_addresses(words: Sequence[str]) -> list[str]:
    """Return the words of a sweep, each parameter that not all jobs have, and that has one value, as a sweep over it.

    What is no sweep Hydra puts into the configuration of all jobs, most of which have no place for it.
    """
    varies = any(_is_sweep(word) for word in words if word.startswith("disturbance="))
    parameters = {word for word in words if address(word) or (varies and "=" in word and _of_disturbance(word))}
    single = {word for word in parameters if not _is_sweep(word)}
    return [f"{word.replace('=', '=choice(', 1)})" if word in single else word for word in words]


def without_addresses(words: Sequence[str]) -> list[str]:
    """Return the words of a single run, addressed parameters without the names of their plugins.

    Raises:
        PluginError: the run has another plugin.
    """
    fitted = []
    for word in words:
        to = address(word)
        if to is not None:
            typed = [other.partition("=")[2] for other in words if other.startswith(f"{to.group}=")]
            if to.name != (typed[-1] if typed else default_names()[to.group]):
                raise PluginError(_nowhere(to))
        fitted.append(word if to is None else to.plain)
    return fitted


def address(word: str) -> Address | None:
    """Read a word; None: it has no address, or is about a disturbance, whose parameters always stand under its name."""
    key, sign, value = word.partition("=")
    parts = key.split(".")
    if not sign or len(parts) < 3 or parts[0] not in GROUPS:
        return None
    group, name, *parameter = parts
    if name not in plugins.names(group) and name not in preset_names(group):
        return None
    return Address(group, name, f"{group}.{'.'.join(parameter)}={value}")


def _of_disturbance(word: str) -> Address | None:
    group, *names = word.lstrip("+~").partition("=")[0].split(".")
    return Address(group, names[0], word) if group == "disturbance" and names else None


def _is_sweep(word: str) -> bool:
    return OverridesParser.create().parse_override(word).is_sweep_override()


def _choice(job: JobWords, group: str) -> tuple[str, ...]:
    """The words that decide which plugin of a group there is."""
    return tuple(w for w in job if owner(w) in ("experiment", "dataset", group) and "." not in w.partition("=")[0])


def _names(composed: Composed, group: str) -> set[str]:
    """What is chosen in a group: a preset and its plugin; every disturbance."""
    part = composed.plain[group] or {}
    return set(part) if group == "disturbance" else {str(composed.choices.get(group)), str(part.get("name"))}


def _nowhere(to: Address) -> str:
    return (
        f"{to.group}.{to.name}...: nothing that is to run has {to.group}={to.name}; choose it too, or leave that out."
    )
