"""The words typed behind `jerkbench run`, checked before Hydra sees them, and in the order in which it takes them."""

import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override
from hydra.errors import HydraException

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.hydra_app.composition import NO_GROUPS
from jerkbench.jobs.labels import GROUPS
from jerkbench.jobs.names import words as as_words
from jerkbench.presets import preset_names
from jerkbench.renamed import new_word, renamed_notice

MAPPING_WORD = re.compile(rf"\+*(?:{'|'.join((*GROUPS, 'disturbance'))})=(?:\[.*\{{|\{{\s*name\s*:)")
"""A plugin with its parameters in one mapping, as Python code gives it; Hydra has names only."""


BRACED = re.compile(r"(filter\.(?:command|file|label))=([^'\"].*)", flags=re.DOTALL)
"""Parameters whose values are text with braces, blanks or parentheses, of which Hydra's grammar has its own opinion."""


def quoted(typed: Sequence[str]) -> list[str]:
    """Return the words with those values in quotation marks that are text for other programs.

    >>> quoted(["filter.command=./mine {recording} {out}"])
    ["filter.command='./mine {recording} {out}'"]
    """
    return [_in_quotes(match) if (match := BRACED.fullmatch(word)) else word for word in typed]


def _in_quotes(match: re.Match[str]) -> str:
    value = match[2].replace("'", "\\'")
    return f"{match[1]}='{value}'"


def refuse_mappings(typed: Sequence[str]) -> None:
    """Refuse a plugin that is given as a mapping, on which Hydra fails, or of which it keeps the wrong name.

    Raises:
        PluginError: there is one; says how to give its parameters.
    """
    for word in typed:
        if MAPPING_WORD.match(word):
            raise PluginError(
                f"{word}: a plugin is chosen by its name alone; give each parameter by itself: {_by_itself(word)}."
            )


def no_assignment(word: str) -> str:
    """Say that ``word`` is no override, and what it may have been meant to be."""
    kinds = [kind for kind in (*GROUPS, "disturbance") if word in plugins.names(kind)]
    hint = f" Did you mean {kinds[0]}={word}?" if kinds else ""
    return f"'{word}' is no KEY=VALUE.{hint} `jerkbench run --help` lists the keys."


def unreadable(word: str) -> str:
    """Say what to do about a word that Hydra's grammar, which has few signs and the letters a to z, cannot read."""
    key, equals, value = word.partition("=")
    if not equals:
        return no_assignment(word)
    text = value.strip("[]'\"").replace("'", "\\'")
    example = f"{key}=['{text}']" if value.startswith("[") else f"{key}='{text}'"
    return f'{word} cannot be read; put text into quotation marks, and the word into those of the shell: "{example}".'


def several_in_one(typed: Sequence[str]) -> str:
    """Say that a list for a group that takes one value is meant to be a sweep; empty: there is none."""
    for word in typed:
        group, _, value = word.partition("=")
        if group in GROUPS and re.fullmatch(r"\[.*,.*\]", value):
            return f"{word}: {group} takes one value; several are a sweep: -m {group}={value[1:-1]}."
    return ""


def swept(typed: Sequence[str], group: str) -> str:
    """The word that gives a group several values to sweep, or an empty string."""
    lists = [word for word in typed if word.startswith(f"{group}=") and re.search(r",(?![^\[]*\])", word)]
    return lists[-1] if lists else ""


def _by_itself(word: str) -> str:
    """The same in words that Hydra takes; where it is a sweep, an example."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    override = OverridesParser.create().parse_override(word)
    group, value = override.key_or_group, override.value()
    several: list[Any] = value if isinstance(value, list) else [value]
    parts = [{"name": part} if isinstance(part, str) else part for part in several]
    if not all(isinstance(part, dict) and "name" in part for part in parts):
        return "disturbance=gnss_outage disturbance.gnss_outage.windows_s=[[50,60]]"
    names = [str(part["name"]) for part in parts]
    chosen = names[0] if len(names) == 1 else f"[{','.join(names)}]"
    return " ".join([f"{group}={chosen}", *(word for part in parts for word in _parameters(group, part))])


def _parameters(group: str, part: dict[str, Any]) -> list[str]:
    owner = f"{group}.{part['name']}" if group == "disturbance" else group
    return as_words(owner, {key: value for key, value in part.items() if key != "name"})


# The words behind `jerkbench run`, checked before Hydra sees them, and in the order in which it
# takes them.

NAMED_GROUPS = (*GROUPS, "disturbance", "noise", "experiment", "cluster")
"""Groups of which a name is chosen."""
COMMANDS = ("run", "multirun", "cfg", "info")
"""Options of Hydra that say what is to be done; one of them at a time."""
FLAGS = ("help", "hydra_help", "resolve", "run", "multirun")
VALUED = ("cfg", "package", "config_path", "config_name", "config_dir", "experimental_rerun", "info")


def arranged_words(words: Sequence[str]) -> list[str]:
    """Return the words with Hydra's options before the overrides, wherever they were typed.

    Raises:
        PluginError: an option is unknown, or two of them contradict each other; an override has no key, or gives a
            group nothing that could be a name.
    """
    parser = get_args_parser()
    setattr(parser, "error", _refuse)  # noqa: B010 - mypy lets no method be replaced
    for word in words:
        if sentence := renamed_notice(word):
            print(sentence, file=sys.stderr)
    known = parser.parse_intermixed_args(quoted([new_word(word) for word in words]))
    _require_sensible(known)
    for word in known.overrides:
        _check(word)
    flags = [_option(name) for name in FLAGS if getattr(known, name)]
    options = [(name, getattr(known, name)) for name in VALUED if getattr(known, name) is not None]
    return [*flags, *(word for name, value in options for word in (_option(name), value)), *known.overrides]


def _refuse(message: str) -> NoReturn:
    raise PluginError(f"{message[0].upper()}{message[1:]}; `jerkbench run --help` says what there is.")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _require_sensible(known: argparse.Namespace) -> None:
    commands = [_option(name) for name in COMMANDS if getattr(known, name)]
    if len(commands) > 1:
        raise PluginError(f"{' and '.join(commands)} ask for different things; give one of them.")
    if known.resolve and not (known.cfg or known.help):
        raise PluginError("--resolve belongs to --cfg: jerkbench run --cfg job --resolve.")
    if known.experimental_rerun is not None:
        raise PluginError("--experimental-rerun needs a file that is not kept here; use `jerkbench rerun DIR ROW`.")
    if known.shell_completion:
        raise PluginError("`jerkbench completion SHELL` prints the script that completes words (bash, fish or zsh).")


def _check(word: str) -> None:
    """Check an override as far as it can be without the configuration."""
    try:
        override = OverridesParser.create().parse_override(word)
    except HydraException as error:
        raise PluginError(unreadable(word)) from error
    if not override.key_or_group:
        raise PluginError(no_assignment(word))
    if override.is_delete():
        _check_deletion(override)
    elif _is_group(override.key_or_group):
        if override.key_or_group == "cluster" and isinstance(override.value(), (ChoiceSweep, list)):
            raise PluginError(f"{word}: a sweep runs on one cluster; give one of {', '.join(_names('cluster'))}.")
        for value in _values(override):
            _check_name(override.key_or_group, value, word)


def _is_group(key: str) -> bool:
    return key in NAMED_GROUPS or key.startswith("hydra/")


def _check_deletion(override: Override) -> None:
    key = override.key_or_group
    if key in NO_GROUPS or (key in NAMED_GROUPS and key != "experiment"):
        raise PluginError(f"~{key}: a run cannot be without {key}; leave it out for the default, or give {key}=...")


def _values(override: Override) -> list[Any]:
    value = override.value()
    if isinstance(value, ChoiceSweep):
        return [Override._convert_value(item) for item in value.list]  # noqa: SLF001 - what a single value goes through
    return [value]


def _check_name(group: str, value: object, word: str) -> None:
    """Refuse what is no name; a mapping, a list of names for one, and a range are refused elsewhere."""
    if value is None or value == []:
        none = " no disturbance is disturbance=none." if group == "disturbance" else " leave it out for the default."
        raise PluginError(f"{word} chooses nothing;{none}")
    for name in value if isinstance(value, list) else [value]:
        if name is None or isinstance(name, (bool, int, float, list)):
            text = str(name) if not isinstance(name, bool) else str(name).lower()
            raise PluginError(unknown(group, text if name is not None else "null", _names(group)))


def _names(group: str) -> list[str]:
    return [*(plugins.names(group) if group in plugins.KINDS else ()), *preset_names(group)]
