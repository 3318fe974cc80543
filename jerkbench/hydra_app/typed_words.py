"""The words typed behind `jerkbench run`, for faults that Hydra says little about."""

import re
from collections.abc import Sequence
from typing import Any

from jerkbench import plugins
from jerkbench.cells.from_names import words as as_words
from jerkbench.cells.labels import GROUPS
from jerkbench.errors import PluginError

NAMED = re.compile(rf"\+*(?:{'|'.join((*GROUPS, 'disturbance'))})=(?:\[.*\{{|\{{\s*name\s*:)")
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
        if NAMED.match(word):
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
