"""Turns what Hydra says about a configuration into a sentence."""

import dataclasses
import re

from jerkbench import plugins
from jerkbench.benchmark.configuration import Schema
from jerkbench.benchmark.noise import Noise
from jerkbench.errors import unknown

NOISE = ("full_key", "object_type", "Config search", "provider=")
"""Beginnings of lines that help nobody."""

PACKAGE = (
    "The file of this experiment lacks its first line '# @package _global_', so all that it sets would stand below the"
    " name 'experiment'; add that line."
)


def sentence(error: Exception) -> str:
    """Say in one sentence what was given, what there is and what to do."""
    text = "\n".join(_chain(error))
    missing = re.search(r"Could not (?:find|load) '([\w/]+)/([^'/]+)'", text)
    if missing:
        return unknown(missing[1], missing[2], _options(text) or _names(missing[1]))
    several = re.search(r"Ambiguous value for argument '([^']+)'", text)
    if several:
        return f"{several[1]} has several values; add -m to run them all, or put a list into [brackets]."
    key = re.search(r"Key '(\w+)' (?:is )?not in '(\w+)'", text)
    if key:
        full = re.search(r"full_key: (\S+)", text)
        if key[1] == "experiment":
            return PACKAGE
        return unknown("option", full[1] if full else key[1], _fields_of(key[2], full[1] if full else ""))
    value = re.search(r"(Value .*)", text)
    if value:
        full = re.search(r"full_key: (\S+)", text)
        return f"{full[1] if full else 'An option'}: {value[1].rstrip('.')}."
    lines = (line.strip() for line in text.splitlines() if line.strip())
    return " ".join(line for line in lines if not line.startswith(NOISE))


def _names(group: str) -> list[str]:
    return plugins.names(group) if group in plugins.KINDS else []


def _fields_of(schema: str, full_key: str) -> list[str]:
    """The options that stand where ``full_key`` does, in the schema that Hydra names."""
    classes = [plugins.schema(kind, name) for kind in plugins.KINDS for name in plugins.names(kind)]
    fields = next((dataclasses.fields(c) for c in (Schema, Noise, *classes) if c.__name__ == schema), ())
    owner, dot, _ = full_key.rpartition(".")
    return [f"{owner}{dot}{f.name}" for f in fields if f.name != "name"]


def _chain(error: BaseException | None) -> list[str]:
    """What the error and its causes say."""
    return [] if error is None else [str(error), *_chain(error.__cause__)]


def _options(text: str) -> list[str]:
    """The options that Hydra lists, one a line, each behind a tab; the schemas among them are not to be chosen."""
    lines = [line.strip() for line in text.splitlines() if line.startswith("\t")]
    return [line for line in lines if line != "schema" and not line.startswith(NOISE)]
