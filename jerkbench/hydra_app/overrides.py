"""Checks and ordering of the arguments of `jerkbench run` for Hydra, and messages for the errors of Hydra."""

import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, QuotedString, RangeSweep, ValueType
from hydra.errors import HydraException, MissingConfigException
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.evaluation.planning import FIRST
from jerkbench.presets import default_names, preset_files
from jerkbench.renamed import new_argument
from jerkbench.report.labels import GROUPS

NAMED_GROUPS = (*GROUPS, "disturbance", "noise", "experiment", "cluster")
"""Groups whose value is the name of a plugin or preset."""

REFUSED = {
    "config_name": "use --config-dir DIR experiment=NAME with the file DIR/experiment/NAME.yaml",
    "config_path": "give --config-dir DIR to use your presets",
    "experimental_rerun": "use `jerkbench rerun DIR ROW`",
    "shell_completion": "see docs/installation.md",
}
"""Options of Hydra that are not supported, with the end of the error message, which describes the alternative."""

MAX_COMBINATIONS = 100_000
"""Maximum number of combinations of a sweep."""

AUTO = re.compile(r"seeds=auto(?:\(max=(\d+)\))?")
MAX_AUTO_SEEDS = 400
"""Default maximum number of seeds for ``seeds=auto``."""

_PARSER = OverridesParser.create()


def arranged_overrides(arguments: Sequence[str]) -> list[str]:
    """Check the arguments of `jerkbench run`, and return them with the options of Hydra before the overrides.

    Raises:
        PluginError: An option or an override is invalid.
    """
    for argument in arguments:
        if (current := new_argument(argument)) != argument:
            print(f"{argument} is now {current}; the old name will be removed in the next version.", file=sys.stderr)
    parser = get_args_parser()
    setattr(parser, "error", _refuse)  # noqa: B010 - mypy forbids the assignment to a method
    arguments = [_quoted(new_argument(argument)) for argument in arguments]
    known = parser.parse_intermixed_args(arguments)
    for name, reason in REFUSED.items():
        if getattr(known, name):
            raise PluginError(f"--{name.replace('_', '-')} is not supported: {reason}.")
    actions = [f"--{name}" for name in ("run", "multirun", "cfg", "info") if getattr(known, name)]
    if len(actions) > 1:
        raise PluginError(f"{' and '.join(actions)} cannot be combined; give only one of these options.")
    if known.resolve and not (known.cfg or known.help):
        raise PluginError("--resolve works only with --cfg, for example `jerkbench run --cfg job --resolve`.")
    overrides = [override for argument in known.overrides for override in seed_options(argument)]
    overrides = [_checked(argument, sweeping=known.multirun) for argument in overrides]
    overrides = _hidden_addresses(overrides) if known.multirun else _without_addresses(overrides)
    return [*(argument for argument in arguments if argument not in known.overrides), *overrides]


def _refuse(message: str) -> NoReturn:
    raise PluginError(f"{message[0].upper()}{message[1:]}; `jerkbench run --help` lists the options.")


def _quoted(argument: str) -> str:
    """Quote commands, file names and labels, because braces and spaces have a meaning in the syntax of Hydra.

    A + before the name of a group is removed, because all groups have a default.
    """
    match = re.fullmatch(r"(filter\.(?:command|file|label)=)([^'\"].*)", argument, flags=re.DOTALL)
    plain = argument.removeprefix("+") if argument.partition("=")[0][1:] in NAMED_GROUPS else argument
    return "{}'{}'".format(match[1], match[2].replace("'", "\\'")) if match else plain


def parsed_override(text: str) -> Override:
    """Parse an override of the form KEY=VALUE.

    Raises:
        PluginError: The text does not have the form KEY=VALUE, or Hydra cannot parse the value.
    """
    quoting = "put text with special characters into quotation marks: \"KEY='TEXT'\""
    unreadable = PluginError(f"'{text}' cannot be read; give KEY=VALUE, and {quoting}. See `jerkbench run --help`.")
    try:
        override = _PARSER.parse_override(text)
    except HydraException as error:
        raise unreadable from error
    if not override.key_or_group:
        raise unreadable
    return override


def seed_options(override: str) -> list[str]:
    """Replace ``seeds=auto(max=400)`` by the options ``seeds`` and ``max_seeds``. Return other overrides unchanged.

    Raises:
        PluginError: The maximum is less than the number of seeds in the first interim analysis.
    """
    match = AUTO.fullmatch(override.replace(" ", "").replace("'", "").replace('"', ""))
    if match is None:
        return [override]
    maximum = int(match[1] or MAX_AUTO_SEEDS)
    if maximum < FIRST:
        raise PluginError(f"{override}: the first interim analysis has {FIRST} seeds; give max={FIRST} or more.")
    return [f"seeds={FIRST}", f"max_seeds={maximum}"]


def _checked(text: str, *, sweeping: bool) -> str:
    """Return an override in which glob(PATTERN) is replaced by the matching names of the group.

    Raises:
        PluginError: The override is invalid, independently of the other overrides.
    """
    override = parsed_override(text)
    key, value, several = override.key_or_group, override.value(), override.is_sweep_override()
    if isinstance(value, Glob):
        # without a matching name, the pattern remains, so that the message about an unknown name contains it
        names = value.filter(sorted(names_in(key))) or value.include
        return _checked(f"{key}={','.join(names)}", sweeping=sweeping)
    if several and not sweeping:
        raise PluginError(f"{text} has several values; add -m to run each value, or write a list in [brackets].")
    if key == "hydra/sweeper" and value not in ("basic", "jerkbench"):
        raise PluginError(f"{text} is not supported; to search for good parameters use `jerkbench tune sampler=tpe`.")
    if override.is_delete():
        raise PluginError(f"{text}: options cannot be removed; omit {key} for its default value, or give {key}=VALUE.")
    if several and key == "cluster":
        raise PluginError(f"{text}: a sweep runs on one cluster; give only one of {', '.join(preset_files(key))}.")
    for choice in value.list if isinstance(value, ChoiceSweep) else [value]:
        if isinstance(choice, list) and key in (*GROUPS, "noise"):
            raise PluginError(f"{text}: {key} accepts one value; for a sweep give -m {key}=A,B.")
        names = choice if isinstance(choice, list) else [choice]
        if key in NAMED_GROUPS and not (names and all(isinstance(name, (str, QuotedString)) for name in names)):
            parameter = f"{key}.{'NAME.' * (key == 'disturbance')}PARAMETER=VALUE"
            available = ", ".join(sorted(names_in(key)))
            separately = f"give parameters separately: {parameter}"
            raise PluginError(f"{text}: {key} accepts only names; {separately}. Available names: {available}.")
    return text


def names_in(group: str) -> set[str]:
    """Return the names of the plugins and presets of a group."""
    return {*(plugins.names(group) if group in plugins.KINDS else ()), *preset_files(group)}


# An address is a key that contains the name of a plugin, for example adaptation.mtf.window=4.


def owner(override: str) -> str:
    """Return the first part of the key of an override, which is the name of a group or of an option."""
    return re.split(r"[=.@]", override.lstrip("+~"), maxsplit=1)[0]


def is_address(path: Sequence[str]) -> bool:
    """Return whether a key is an address: a group, the name of a plugin or preset, and a parameter."""
    return len(path) == 3 and (path[0] == "disturbance" or (path[0] in GROUPS and path[1] in names_in(path[0])))


def _hidden_addresses(overrides: Sequence[str]) -> list[str]:
    """Convert overrides with an address to sweeps with one value.

    Hydra applies overrides that are not sweeps before the sweep starts, and would reject the addresses.
    """
    return [
        override.replace("=", "=choice(", 1) + ")"
        if is_address(override.partition("=")[0].split("."))
        and not _PARSER.parse_override(override).is_sweep_override()
        else override
        for override in overrides
    ]


def _without_addresses(overrides: Sequence[str]) -> list[str]:
    """Remove the names of plugins from the keys of the overrides of a single run."""
    choices = {**default_names(), **dict(override.split("=", 1) for override in overrides if "=" in override)}
    fitted = []
    for override in overrides:
        path = override.partition("=")[0].split(".")
        if is_address(path) and path[0] != "disturbance":
            group, name, _ = path
            if name != choices[group]:
                raise PluginError(f"{override} needs {group}={name}; add {group}={name}, or remove the parameter.")
            fitted.append(f"{group}.{override.split('.', 2)[2]}")
        else:
            fitted.append(override)
    return fitted


# Ranges of a sweep, and the number of its combinations.


def ranges_listed(overrides: Sequence[Override]) -> list[Override]:
    """Replace each range by a list of its values, rounded to 12 decimals (0.3 instead of 0.30000000000000004).

    Raises:
        PluginError: A range is infinite or empty, or there are more combinations than `MAX_COMBINATIONS`.
    """
    count = math.prod(map(_count, {override.get_key_element(): override for override in overrides}.values()))
    if count > MAX_COMBINATIONS:
        raise PluginError(f"The sweep has {count:,} combinations, more than {MAX_COMBINATIONS:,}. Split the sweep.")
    return [_listed(override) for override in overrides]


def ignored_combinations(params: Mapping[str, Any] | None, overrides: Sequence[str]) -> int:
    """Return the number of combinations that a single run ignores, if its experiment defines a sweep.

    Args:
        params: The swept values of the experiment, by key (``hydra.sweeper.params``).
        overrides: The overrides of the run, which replace the swept values of the same keys.
    """
    given = {override.partition("=")[0] for override in overrides}
    swept = [f"{key}={value}" for key, value in (params or {}).items() if key not in given]
    return math.prod(map(_count, _PARSER.parse_overrides(swept))) - 1


def _count(override: Override) -> int:
    values: Any = override.value()
    if not isinstance(override.value(), RangeSweep):
        return len(list(override.sweep_iterator())) if override.is_discrete_sweep() else 1
    count = (values.stop - values.start) / values.step if values.step else math.nan
    if not 0 < count < math.inf:
        reason = "the range must be finite, and its stop, which is excluded, must lie beyond the start"
        raise PluginError(f"{override.input_line}: {reason}.")
    return math.ceil(round(count, 9))


def _listed(override: Override) -> Override:
    values: Any = override.value()
    if not isinstance(override.value(), RangeSweep):
        return override
    numbers: list[Any] = [round(values.start + k * values.step, 12) for k in range(_count(override))]
    choices = ChoiceSweep(tags=values.tags, list=numbers, shuffle=values.shuffle)
    return replace(override, value_type=ValueType.CHOICE_SWEEP, _value=choices)


# Errors of Hydra and OmegaConf.


def no_option(key: str, available: Iterable[object], *, sweeping: bool) -> str:
    """Return the error message for an unknown key. The list ``available`` contains the valid keys of the same group."""
    group, dot, parameter = key.rpartition(".")
    hint = f" To set it for one of several plugins, give {group}.NAME.{parameter}=VALUE." if group in GROUPS else ""
    names = [f"{group}{dot}{name}" for name in available if name not in ("name", "hydra")]
    return unknown("option", key, names) + hint * sweeping


def hydra_message(error: BaseException, *, sweeping: bool = False) -> str:
    """Return an error message in one line for an exception of Hydra or OmegaConf."""
    line = ""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MissingConfigException) and (path := cause.missing_cfg_file):
            group, _, name = path.rpartition("/")
            broken = plugins.left_out(group) if group in plugins.KINDS else {}
            options = cause.options or names_in(group)
            return broken.get(name) or unknown(group, name, [option for option in options if option != "schema"])
        line = next(filter(None, map(str.strip, str(cause).splitlines())), line)
        if isinstance(cause, OmegaConfBaseException) and (key := cause.full_key):
            if not isinstance(cause, (ConfigAttributeError, ConfigKeyError)):
                return f"{key}: {line.rstrip('.')}."
            if key == "experiment":
                return "The first line of an experiment must be '# @package _global_'; add it to the file."
            return no_option(key, cause.parent_node or (), sweeping=sweeping)
        cause = cause.__cause__ or cause.__context__
    return line
