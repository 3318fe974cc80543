"""The words behind `jerkbench run`, in the order in which Hydra takes them; what is wrong with them, as sentences."""

import argparse
import dataclasses
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn, cast

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override
from hydra.errors import HydraException

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.hydra_app.composition import NO_GROUPS
from jerkbench.hydra_app.configuration import Schema, ToldR
from jerkbench.jobs.job import Noise
from jerkbench.jobs.labels import GROUPS
from jerkbench.jobs.names import words as as_words
from jerkbench.presets import preset_names
from jerkbench.renamed import new_word, renamed_notice

MAPPING_WORD = re.compile(rf"\+*(?:{'|'.join((*GROUPS, 'disturbance'))})=(?:\[.*\{{|\{{\s*name\s*:)")
"""A plugin with its parameters in one mapping, as Python code gives it; Hydra has names only."""


QUOTE, ESCAPED = "'", "\\'"
BRACED = re.compile(r"\A(filter\.(?:command|file|label))=([^'\"].*)\Z", flags=re.DOTALL)
"""Parameters whose values are text with braces, blanks or parentheses, of which Hydra's grammar has its own opinion."""


def quoted(typed: Sequence[str]) -> list[str]:
    """Return the words with those values in quotation marks that are text for other programs.

    >>> quoted(["filter.command=./mine {recording} {out}"])
    ["filter.command='./mine {recording} {out}'"]
    """
    return [BRACED.sub(lambda match: f"{match[1]}='{match[2].replace(QUOTE, ESCAPED)}'", word) for word in typed]


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
    override = OverridesParser.create().parse_override(word)
    group, value = override.key_or_group, override.value()
    several: list[Any] = value if isinstance(value, list) else [value]
    parts = [{"name": part} if isinstance(part, str) else part for part in several]
    if not all(isinstance(part, dict) and "name" in part for part in parts):
        return "disturbance=gnss_outage disturbance.gnss_outage.windows_s=[[50,60]]"
    names = [str(part["name"]) for part in parts]
    typed = [f"{group}={names[0] if len(names) == 1 else '[' + ','.join(names) + ']'}"]
    for name, part in zip(names, parts, strict=True):
        owner = f"{group}.{name}" if group == "disturbance" else group
        typed += as_words(owner, {key: value for key, value in part.items() if key != "name"})
    return " ".join(typed)


# The words behind `jerkbench run`, checked before Hydra sees them, and in the order in which it
# takes them.

NAMED_GROUPS = (*GROUPS, "disturbance", "noise", "experiment", "cluster")
"""Groups of which a name is chosen."""
COMMANDS = ("run", "multirun", "cfg", "info")
"""Options of Hydra that say what is to be done; one of them at a time."""
FLAGS = ("help", "hydra_help", "resolve", "run", "multirun")
VALUED = ("cfg", "package", "config_dir", "experimental_rerun", "info")


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
    for name in ("config_path", "config_name"):
        if getattr(known, name) is not None:
            raise PluginError(
                f"{_option(name)} is not supported, because every run starts from conf/config.yaml; write a preset"
                " DIR/experiment/NAME.yaml and give --config-dir DIR experiment=NAME."
            )
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
    key = override.key_or_group
    if not key:
        raise PluginError(no_assignment(word))
    if override.is_delete():
        if key in NO_GROUPS or (key in NAMED_GROUPS and key != "experiment"):
            raise PluginError(f"~{key}: a run cannot be without {key}; leave it out for the default, or give {key}=...")
    elif key in NAMED_GROUPS or key.startswith("hydra/"):
        value = override.value()
        if key == "cluster" and isinstance(value, (ChoiceSweep, list)):
            raise PluginError(f"{word}: a sweep runs on one cluster; give one of {', '.join(_names('cluster'))}.")
        convert = Override._convert_value  # noqa: SLF001 - what a single value goes through
        for one in [convert(item) for item in value.list] if isinstance(value, ChoiceSweep) else [value]:
            _check_name(key, one, word)


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


# Hydra's errors in a configuration, as sentences.

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
    messages, cause = list[str](), cast("BaseException | None", error)
    while cause is not None:
        messages.append(str(cause))
        cause = cause.__cause__
    text = "\n".join(messages)
    if disturbance := re.search(r"Could not override 'disturbance\.(\w+)([^']*)'", text):
        return _under_its_name(disturbance[1], typed, inside=bool(disturbance[2]))
    if "is not a subclass of" in text and (sentence := several_in_one(typed)):
        return sentence
    return _of_configuration(text, typed)


def _under_its_name(key: str, typed: Sequence[str], *, inside: bool) -> str:
    """A key below ``disturbance`` that is no chosen one: a parameter, or one that is not chosen, or nothing known."""
    known = plugins.names("disturbance")
    if owners := [] if inside else [name for name in known if key in _parameters("disturbance", name)]:
        chosen = {name for word in typed if word.startswith("disturbance=") for name in re.findall(r"\w+", word)}
        meant = [name for name in owners if name in chosen] or owners
        examples = " or ".join(f"disturbance.{name}.{key}=..." for name in meant)
        return f"The parameters of a disturbance stand under its name: {examples}"
    if key in known:
        return f"The disturbance {key} is not among the chosen; add it: disturbance=[...,{key}]."
    return unknown("disturbance", key, known)


def _parameters(kind: str, name: str) -> set[str]:
    return {f.name for f in dataclasses.fields(plugins.get(kind, name))}


def _of_configuration(text: str, typed: Sequence[str]) -> str:
    if missing := re.search(r"Could not (?:find|load) '([\w/]+)/([^'/]+)'", text):
        return _no_choice(missing[1], missing[2], _options(text))
    if several := re.search(r"Ambiguous value for argument '([^']+)'", text):
        return f"{several[1]} has several values; add -m to run them all, or put a list into [brackets]."
    full = re.search(r"full_key: (\S+)", text)
    if key := re.search(r"Key '(\w+)' (?:is )?not in '(\w+)'", text):
        if key[1] == "experiment":
            return NO_PACKAGE_LINE
        return _no_option(key[2], full[1] if full else key[1], typed)
    if value := re.search(r"(Value .*)", text):
        return f"{full[1] if full else 'An option'}: {value[1].rstrip('.')}."
    lines = (line.strip() for line in text.splitlines() if line.strip())
    return " ".join(line for line in lines if not line.startswith(UNHELPFUL))


def _no_choice(group: str, name: str, options: Sequence[str]) -> str:
    if name.startswith("["):
        return f"{group}: '{name}' in quotes is one name; drop the quotes around the list: none,{name}."
    if group == "hydra/launcher" and name in LAUNCHERS:
        return f"The launcher {name} is not installed: pip install {LAUNCHERS[name]}, or leave it out."
    broken = plugins.left_out(group) if group in plugins.KINDS else {}
    return broken.get(name) or unknown(group, name, options or _plugin_names(group))


def _plugin_names(group: str) -> list[str]:
    return plugins.names(group) if group in plugins.KINDS else []


def _no_option(schema: str, full_key: str, typed: Sequence[str]) -> str:
    """Say which option there is not; in a sweep, that it is one combination that has it not."""
    group = full_key.partition(".")[0]
    fields, several = _fields_of(schema, full_key), swept(typed, group)
    name = next((n for n in _plugin_names(group) if plugins.get(group, n).__name__ == schema), schema)
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
    swept_names = [name for name in several.partition("=")[2].split(",") if name in _plugin_names(group)]
    having = (name for name in swept_names if parameter in _parameters(group, name))
    return f"{group}.{next(having, 'NAME')}.{parameter}"


def _fields_of(schema: str, full_key: str) -> list[str]:
    """The options that stand where ``full_key`` does, in the schema that Hydra names."""
    classes = [plugins.schema(kind, name) for kind in plugins.KINDS for name in plugins.names(kind)]
    fields = next((dataclasses.fields(c) for c in (Schema, Noise, ToldR, *classes) if c.__name__ == schema), ())
    owner, dot, _ = full_key.rpartition(".")
    return [f"{owner}{dot}{f.name}" for f in fields if f.name != "name"]


def _options(text: str) -> list[str]:
    """The options that Hydra lists, one a line, each behind a tab; the schemas among them are not to be chosen."""
    lines = [line.strip() for line in text.splitlines() if line.startswith("\t")]
    return [line for line in lines if line != "schema" and not line.startswith(UNHELPFUL)]
