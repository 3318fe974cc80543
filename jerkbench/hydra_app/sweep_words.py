"""The words of a sweep: ranges as they were typed, a limit of combinations, and each disturbance's own parameters."""

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any

from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.types import ChoiceSweep, Override, RangeSweep, ValueType
from omegaconf import DictConfig

from jerkbench.errors import PluginError
from jerkbench.hydra_app.composition import owner

Job = Sequence[str]
MOST = 100_000
"""Combinations of one sweep."""


def listed(overrides: Sequence[Override]) -> list[Override]:
    """Return the overrides with each range as the list of its values.

    Hydra adds binary fractions (.1 + .1 + .1 is .30000000000000004, and .4 comes after it, although a range ends before
    its stop); here the decimals are added that were typed.

    Raises:
        PluginError: a range has no end or no values, or there are more combinations than `MOST`.
    """
    last = {override.get_key_element(): override for override in overrides}  # a key that is given twice has its last
    count = math.prod(_count(override) for override in last.values())
    if count > MOST:
        raise PluginError(
            f"The sweep has {count:,} combinations; {MOST:,} are the most of one sweep: give fewer values, or split it."
        )
    return [_listed(override) for override in overrides]


def _count(override: Override) -> int:
    value = override.value()
    if isinstance(value, RangeSweep):
        return _length(value, str(override.input_line))
    return len(list(override.sweep_iterator())) if override.is_discrete_sweep() else 1


def _length(values: RangeSweep, typed: str) -> int:
    start, stop, step = _decimals(values)
    if not (start.is_finite() and stop.is_finite() and step.is_finite() and step):
        raise PluginError(f"{typed}: start, stop and step of a range are finite numbers, the step not 0.")
    count = math.ceil((stop - start) / step)
    if count < 1:
        raise PluginError(f"{typed} has no values: a range goes from its start to before its stop.")
    return count


def _listed(override: Override) -> Override:
    value = override.value()
    if not isinstance(value, RangeSweep):
        return override
    start, _, step = _decimals(value)
    whole = all(isinstance(number, int) for number in (value.start, value.stop, value.step))
    numbers: list[Any] = [start + k * step for k in range(_length(value, str(override.input_line)))]
    choices = ChoiceSweep(tags=value.tags, list=[int(n) if whole else float(n) for n in numbers], shuffle=value.shuffle)
    return replace(override, value_type=ValueType.CHOICE_SWEEP, _value=choices)


def _decimals(values: RangeSweep) -> tuple[Decimal, Decimal, Decimal]:
    """Start, stop and step as they were typed."""
    return Decimal(str(values.start)), Decimal(str(values.stop)), Decimal(str(values.step))


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
