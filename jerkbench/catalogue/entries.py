"""The entries of the catalogue: plugins from their docstrings, presets from their files."""

import inspect
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.notices import notify

PRESET_GROUPS = ("noise", "experiment")
"""Groups that hold presets only."""


class Entry(NamedTuple):
    """One name of the catalogue.

    Attributes:
        name: as one types it.
        summary: one line about it.
        preset: whether it is a file of values, and no class.
        package: the distribution's package that it comes from.
    """

    name: str
    summary: str
    preset: bool = False
    package: str = "jerkbench"


def kinds_asked(kind: str | None) -> tuple[str, ...]:
    """Return ``kind`` alone, or every kind.

    Raises:
        PluginError: no such kind.
    """
    kinds = (*plugins.KINDS, *PRESET_GROUPS)
    if kind is not None and kind not in kinds:
        raise PluginError(unknown("kind", kind, kinds))
    return (kind,) if kind else kinds


def kind_of(name: str) -> str:
    """Return the kind of which there is a ``name``.

    Raises:
        PluginError: there is none, or there are several.
    """
    names = {
        kind: {*(plugins.names(kind) if kind in plugins.KINDS else ()), *preset_files(kind)}
        for kind in kinds_asked(None)
    }
    having = [kind for kind, of in names.items() if name in of]
    if name in names:
        raise PluginError(f"{name} is a kind: jerkbench list {name}, or jerkbench show {name} NAME.")
    if not having:
        raise PluginError(unknown("plugin or preset", name, set().union(*names.values())))
    if len(having) > 1:
        words = " or ".join(f"jerkbench show {kind} {name}" for kind in having)
        raise PluginError(f"{name} names {len(having)} things; give the kind: {words}.")
    return having[0]


def entries(kind: str) -> list[Entry]:
    """Return what there is of a kind, sorted by name; a plugin that cannot be loaded is left out, with a notice."""
    by_name = {entry.name: entry for entry in _plugins(kind)} if kind in plugins.KINDS else {}
    for sentence in plugins.left_out(kind).values() if kind in plugins.KINDS else ():
        notify(sentence)
    by_name |= {name: Entry(name, _first_comment(path), preset=True) for name, path in preset_files(kind).items()}
    return [by_name[name] for name in sorted(by_name)]


def preset_files(kind: str) -> dict[str, Path]:
    """Return the file of each preset of a kind."""
    from jerkbench.presets import config_folder

    return {path.stem: path for path in sorted((config_folder() / kind).glob("*.yaml"))}


def plugin_class(kind: str, name: str) -> type:
    """Return the class of a plugin.

    Raises:
        PluginError: there is none of that name; says what there is, presets too.
    """
    presets = preset_files(kind)
    if kind in PRESET_GROUPS:
        raise PluginError(unknown(kind, name, presets))
    if kind in plugins.KINDS and name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, presets))
    return plugins.get(kind, name)


def _plugins(kind: str) -> Iterator[Entry]:
    for name in plugins.names(kind):
        cls = plugins.get(kind, name)
        yield Entry(name, (inspect.getdoc(cls) or "").split("\n", 1)[0], package=cls.__module__.partition(".")[0])


def _first_comment(path: Path) -> str:
    """The first sentence of the comment at the top of a preset."""
    comment = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    text = " ".join(line.lstrip("# ") for line in comment if "@package" not in line)
    return text.split(". ")[0].rstrip(".") + "."
