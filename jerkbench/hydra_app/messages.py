"""Hydra's errors in a configuration, as sentences."""

import dataclasses
import re
from collections.abc import Sequence

from jerkbench import plugins
from jerkbench.errors import unknown
from jerkbench.hydra_app.configuration import Schema, ToldR
from jerkbench.hydra_app.typed_words import several_in_one, swept
from jerkbench.jobs.job import Noise

UNHELPFUL = ("full_key", "object_type", "Config search", "provider=")
"""Beginnings of lines that help nobody."""

LAUNCHERS = {
    "joblib": "hydra-joblib-launcher",
    "ray": "hydra-ray-launcher",
    "ray_aws": "hydra-ray-launcher",
    "rq": "hydra-rq-launcher",
    "submitit_local": "hydra-submitit-launcher",
    "submitit_slurm": "hydra-submitit-launcher",
}
"""Hydra's own launchers, and the distribution that each is in."""

NO_PACKAGE_LINE = (
    "The file of this experiment lacks its first line '# @package _global_', so all that it sets would stand below the"
    " name 'experiment'; add that line."
)


def hydra_sentence(error: Exception, typed: Sequence[str] = ()) -> str:
    """Say what was given, what there is and what to do.

    Args:
        error: what Hydra raised.
        typed: the words behind `jerkbench run`.
    """
    text = "\n".join(_chain(error))
    return _of_words(text, typed) or _of_configuration(text, typed)


def _of_words(text: str, typed: Sequence[str]) -> str:
    """Return the sentence for a word that no configuration allows, or an empty string."""
    disturbance = re.search(r"Could not override 'disturbance\.(\w+)([^']*)'", text)
    if disturbance:
        return _under_its_name(disturbance[1], typed, inside=bool(disturbance[2]))
    return several_in_one(typed) if "is not a subclass of" in text else ""


def _under_its_name(key: str, typed: Sequence[str], *, inside: bool) -> str:
    """A key below ``disturbance`` that is no chosen one: a parameter, or one that is not chosen, or nothing known."""
    known = plugins.names("disturbance")
    if owners := [] if inside else [name for name in known if _has(name, key)]:
        chosen = {name for word in typed if word.startswith("disturbance=") for name in re.findall(r"\w+", word)}
        meant = [name for name in owners if name in chosen] or owners
        examples = " or ".join(f"disturbance.{name}.{key}=..." for name in meant)
        return f"The parameters of a disturbance stand under its name: {examples}"
    if key in known:
        return f"The disturbance {key} is not among the chosen; add it: disturbance=[...,{key}]."
    return unknown("disturbance", key, known)


def _has(disturbance: str, parameter: str) -> bool:
    return parameter in {f.name for f in dataclasses.fields(plugins.get("disturbance", disturbance))}


def _of_configuration(text: str, typed: Sequence[str]) -> str:
    missing = re.search(r"Could not (?:find|load) '([\w/]+)/([^'/]+)'", text)
    if missing:
        return _no_choice(missing[1], missing[2], _options(text))
    several = re.search(r"Ambiguous value for argument '([^']+)'", text)
    if several:
        return f"{several[1]} has several values; add -m to run them all, or put a list into [brackets]."
    key = re.search(r"Key '(\w+)' (?:is )?not in '(\w+)'", text)
    if key:
        full = re.search(r"full_key: (\S+)", text)
        if key[1] == "experiment":
            return NO_PACKAGE_LINE
        return _no_option(key[2], full[1] if full else key[1], typed)
    value = re.search(r"(Value .*)", text)
    if value:
        full = re.search(r"full_key: (\S+)", text)
        return f"{full[1] if full else 'An option'}: {value[1].rstrip('.')}."
    lines = (line.strip() for line in text.splitlines() if line.strip())
    return " ".join(line for line in lines if not line.startswith(UNHELPFUL))


def _no_choice(group: str, name: str, options: Sequence[str]) -> str:
    if name.startswith("["):
        return f"{group}: '{name}' in quotes is one name; drop the quotes around the list: none,{name}."
    if group == "hydra/launcher" and name in LAUNCHERS:
        return f"The launcher {name} is not installed: pip install {LAUNCHERS[name]}, or leave it out."
    broken = plugins.left_out(group) if group in plugins.KINDS else {}
    return broken.get(name) or unknown(group, name, options or _names(group))


def _names(group: str) -> list[str]:
    return plugins.names(group) if group in plugins.KINDS else []


def _no_option(schema: str, full_key: str, typed: Sequence[str]) -> str:
    """Say which option there is not; in a sweep, that it is one combination that has it not."""
    group = full_key.partition(".")[0]
    fields, several = _fields_of(schema, full_key), swept(typed, group)
    name = next((n for n in _names(group) if plugins.get(group, n).__name__ == schema), schema)
    if fields or schema == Schema.__name__:
        sentence = unknown("option", full_key, fields)
    else:
        sentence = f"The {group} {name} has no parameters, so {full_key} cannot be set."
    if not several:
        return sentence
    return (
        f"{sentence} That is the combination with {group}={name}; give a parameter that only some of {several} have by"
        f" the name of its plugin: {_addressed(full_key, several)}=..."
    )


def _addressed(full_key: str, several: str) -> str:
    """The key with the name of the first of the swept plugins that has such a parameter."""
    group, _, parameter = full_key.partition(".")
    swept_names = [name for name in several.partition("=")[2].split(",") if name in _names(group)]
    having = [n for n in swept_names if parameter in {f.name for f in dataclasses.fields(plugins.get(group, n))}]
    return f"{group}.{next(iter(having), 'NAME')}.{parameter}"


def _fields_of(schema: str, full_key: str) -> list[str]:
    """The options that stand where ``full_key`` does, in the schema that Hydra names."""
    classes = [plugins.schema(kind, name) for kind in plugins.KINDS for name in plugins.names(kind)]
    fields = next((dataclasses.fields(c) for c in (Schema, Noise, ToldR, *classes) if c.__name__ == schema), ())
    owner, dot, _ = full_key.rpartition(".")
    return [f"{owner}{dot}{f.name}" for f in fields if f.name != "name"]


def _chain(error: BaseException | None) -> list[str]:
    """Return the messages of the error and of its causes."""
    return [] if error is None else [str(error), *_chain(error.__cause__)]


def _options(text: str) -> list[str]:
    """The options that Hydra lists, one a line, each behind a tab; the schemas among them are not to be chosen."""
    lines = [line.strip() for line in text.splitlines() if line.startswith("\t")]
    return [line for line in lines if line != "schema" and not line.startswith(UNHELPFUL)]
