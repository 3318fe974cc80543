"""The arguments of `jerkbench run`: checked, in the order that Hydra needs; and Hydra's errors in one sentence."""

import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any, NoReturn

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, QuotedString, RangeSweep, ValueType
from hydra.errors import HydraException, MissingConfigException
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.hydra_app.looks import typed as typed_seeds
from jerkbench.presets import default_names, preset_names
from jerkbench.renamed import new_word, renamed_notice
from jerkbench.report.labels import GROUPS

NAMED_GROUPS = (*GROUPS, "disturbance", "noise", "experiment", "cluster")
"""Groups of which a name is chosen."""

REFUSED = {
    "config_path": "give --config-dir DIR for presets of your own",
    "config_name": "every run starts from conf/config.yaml; give experiment=NAME",
    "experimental_rerun": "use `jerkbench rerun DIR ROW`",
    "shell_completion": "docs/installation.md describes completion",
}
"""Options of Hydra that are not supported, and what to do instead."""

MAX_COMBINATIONS = 100_000
"""Combinations of one sweep."""

_PARSER = OverridesParser.create()


def arranged_words(words: Sequence[str]) -> list[str]:
    """Return the arguments with Hydra's options before the overrides, wherever they were typed.

    Raises:
        PluginError: an option or an override is invalid.
    """
    for word in words:
        if notice := renamed_notice(word):
            print(notice, file=sys.stderr)
    parser = get_args_parser()
    setattr(parser, "error", _refuse)  # noqa: B010 - mypy lets no method be replaced
    words = [_quoted(new_word(word)) for word in words]
    known = parser.parse_intermixed_args(words)
    for name, reason in REFUSED.items():
        if getattr(known, name):
            raise PluginError(f"{_option(name)} is not supported: {reason}.")
    actions = [_option(name) for name in ("run", "multirun", "cfg", "info") if getattr(known, name)]
    if len(actions) > 1:
        raise PluginError(f"{' and '.join(actions)} exclude each other; give one of them.")
    if known.resolve and not (known.cfg or known.help):
        raise PluginError("--resolve belongs to --cfg: jerkbench run --cfg job --resolve.")
    overrides = [one for word in known.overrides for one in typed_seeds(word)]
    for word in overrides:
        _check(word, sweeping=known.multirun)
    overrides = _hidden_addresses(overrides) if known.multirun else _without_addresses(overrides)
    return [*(word for word in words if word not in known.overrides), *overrides]


def _refuse(message: str) -> NoReturn:
    raise PluginError(f"{message[0].upper()}{message[1:]}; `jerkbench run --help` lists the options.")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _quoted(word: str) -> str:
    """Put text for other programs into quotation marks; Hydra's grammar has its own rules for braces and blanks."""
    match = re.fullmatch(r"(filter\.(?:command|file|label)=)([^'\"].*)", word, flags=re.DOTALL)
    return "{}'{}'".format(match[1], match[2].replace("'", "\\'")) if match else word


def parsed_override(word: str) -> Override:
    """Parse an override.

    Raises:
        PluginError: it is not of the form KEY=VALUE, or Hydra's grammar cannot read its value.
    """
    unreadable = PluginError(
        f"'{word}' cannot be read; give KEY=VALUE, and put text with special characters into quotation marks:"
        " \"KEY='TEXT'\". `jerkbench run --help` lists the keys."
    )
    try:
        override = _PARSER.parse_override(word)
    except HydraException as error:
        raise unreadable from error
    if not override.key_or_group:
        raise unreadable
    return override


def _check(word: str, *, sweeping: bool) -> None:
    """Check an override as far as possible without the configuration."""
    override = parsed_override(word)
    key, value, several = override.key_or_group, override.value(), override.is_sweep_override()
    if several and not sweeping:
        raise PluginError(f"{word} has several values; add -m to run them all, or put a list into [brackets].")
    if override.is_delete():
        raise PluginError(f"{word}: nothing can be removed; leave {key} out for its default, or give {key}=VALUE.")
    if several and key == "cluster":
        raise PluginError(f"{word}: a sweep runs on one cluster; give one of {', '.join(preset_names(key))}.")
    for one in value.list if isinstance(value, ChoiceSweep) else [value]:
        if isinstance(one, list) and key in (*GROUPS, "noise"):
            raise PluginError(f"{word}: {key} takes one value; for a sweep give -m {key}=A,B.")
        names = one if isinstance(one, list) else [one]
        if key in NAMED_GROUPS and not (names and all(isinstance(name, (str, QuotedString)) for name in names)):
            parameter = f"{key}.{'NAME.' * (key == 'disturbance')}PARAMETER=VALUE"
            raise PluginError(
                f"{word}: {key} takes names only; give each parameter by itself ({parameter}). Available:"
                f" {', '.join(sorted(names_in(key)))}."
            )


def names_in(group: str) -> set[str]:
    """Return the plugins and presets of a group."""
    return {*(plugins.names(group) if group in plugins.KINDS else ()), *preset_names(group)}


# Parameters with the name of their plugin: adaptation.mtf.window=4.


def owner(word: str) -> str:
    """Return the group, or the first part of the key, that an override is about."""
    return re.split(r"[=.@]", word.lstrip("+~"), maxsplit=1)[0]


def is_address(path: Sequence[str]) -> bool:
    """Whether the names of a key are a group, the name of a plugin or preset, and a parameter."""
    return len(path) == 3 and (path[0] == "disturbance" or (path[0] in GROUPS and path[1] in names_in(path[0])))


def _hidden_addresses(words: Sequence[str]) -> list[str]:
    """Return addressed parameters as sweeps of one value, because Hydra composes all other overrides of a sweep."""
    return [
        word.replace("=", "=choice(", 1) + ")"
        if is_address(word.partition("=")[0].split(".")) and not _PARSER.parse_override(word).is_sweep_override()
        else word
        for word in words
    ]


def _without_addresses(words: Sequence[str]) -> list[str]:
    """Return the overrides of a single run, addressed parameters without the names of their plugins."""
    chosen = {**default_names(), **dict(word.split("=", 1) for word in words if "=" in word)}
    fitted = []
    for word in words:
        path = word.partition("=")[0].split(".")
        if is_address(path) and path[0] != "disturbance":
            group, name, _ = path
            if name != chosen[group]:
                raise PluginError(f"{word}: {group}={name} is not chosen; choose it too, or leave the parameter out.")
            fitted.append(f"{group}.{word.split('.', 2)[2]}")
        else:
            fitted.append(word)
    return fitted


# Ranges of a sweep, and the number of its combinations.


def ranges_listed(overrides: Sequence[Override]) -> list[Override]:
    """Return the overrides with each range as the list of its values.

    Hydra adds binary fractions (.1 + .1 + .1 is .30000000000000004); here the decimals are added that were typed.

    Raises:
        PluginError: a range has no end or no values, or there are more combinations than `MAX_COMBINATIONS`.
    """
    count = math.prod(map(_count, {override.get_key_element(): override for override in overrides}.values()))
    if count > MAX_COMBINATIONS:
        raise PluginError(
            f"The sweep has {count:,} combinations; the maximum is {MAX_COMBINATIONS:,}: give fewer values or split it."
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
    return math.prod(map(_count, _PARSER.parse_overrides(swept))) - 1


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
    """Start and step of a range as they were typed, and its number of values."""
    values: Any = override.value()
    start, stop, step = (Decimal(str(number)) for number in (values.start, values.stop, values.step))
    if not (start.is_finite() and stop.is_finite() and step.is_finite() and step):
        raise PluginError(f"{override.input_line}: start, stop and step must be finite, and step must not be 0.")
    count = math.ceil((stop - start) / step)
    if count < 1:
        raise PluginError(f"{override.input_line} has no values: a range goes from its start to before its stop.")
    return start, step, count


# Errors of Hydra and OmegaConf.


def no_option(key: str, available: Iterable[object], *, sweeping: bool) -> str:
    """Return the error message for a ``key`` that the configuration does not have; ``available`` are its siblings."""
    group, dot, parameter = key.rpartition(".")
    hint = f" Address a parameter of one of several plugins: {group}.NAME.{parameter}=VALUE." if group in GROUPS else ""
    names = [f"{group}{dot}{name}" for name in available if name not in ("name", "hydra")]
    return unknown("option", key, names) + hint * sweeping


def hydra_sentence(error: BaseException, *, sweeping: bool = False) -> str:
    """Return the essential line of an error of Hydra."""
    line = ""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MissingConfigException) and (path := cause.missing_cfg_file):
            group, _, name = path.rpartition("/")
            broken = plugins.left_out(group) if group in plugins.KINDS else {}
            options = cause.options or names_in(group)
            return broken.get(name) or unknown(group, name, [one for one in options if one != "schema"])
        line = next(filter(None, map(str.strip, str(cause).splitlines())), line)
        if isinstance(cause, OmegaConfBaseException) and (key := cause.full_key):
            if not isinstance(cause, (ConfigAttributeError, ConfigKeyError)):
                return f"{key}: {line.rstrip('.')}."
            if key == "experiment":
                return "The first line of an experiment must be '# @package _global_'; add it to the file."
            return no_option(key, cause.parent_node or (), sweeping=sweeping)
        cause = cause.__cause__ or cause.__context__
    return line
