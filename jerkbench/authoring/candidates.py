"""The plugins that a package offers: by its distribution, its module or its folder."""

import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points
from pathlib import Path
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError

GROUP = "jerkbench."
"""Entry points in groups that begin so are plugins."""

SOURCES = ("", "src")
"""Where a folder's modules may lie."""


class Candidate(NamedTuple):
    """What may be a plugin.

    Attributes:
        kind: as its entry point says, right or wrong.
        name: likewise.
        load: imports it.
    """

    kind: str
    name: str
    load: Callable[[], Any]


def candidates(package: str) -> list[Candidate]:
    """Return the plugins of ``package``: a folder with a pyproject.toml, a distribution, or a module.

    Raises:
        PluginError: there is no such package, or it has no plugin.
    """
    if Path(package).is_dir():
        plugins_of_package = _of_entry_points(_of_folder(Path(package)))
    else:
        plugins_of_package = _of_entry_points(_of_distribution(package)) or _of_module(package)
    if not plugins_of_package:
        raise PluginError(
            f'{package} has no plugin: write an entry point, [project.entry-points."jerkbench.KIND"] with NAME = '
            '"MODULE:CLASS", into its pyproject.toml, and install it anew.'
        )
    return plugins_of_package


def _of_folder(folder: Path) -> Iterator[EntryPoint]:
    """The entry points of its pyproject.toml; its modules come first from now on."""
    project = folder / "pyproject.toml"
    if not project.is_file():
        raise PluginError(f"{folder} has no pyproject.toml; give the folder of a package, or the name of one.")
    sys.path[:0] = [str((folder / source).resolve()) for source in SOURCES if (folder / source).is_dir()]
    try:
        groups = tomllib.loads(project.read_text(encoding="utf-8")).get("project", {}).get("entry-points", {})
    except tomllib.TOMLDecodeError as error:
        raise PluginError(f"{project} cannot be read: {error}.") from error
    for group, names in groups.items():
        yield from (EntryPoint(name, value, group) for name, value in names.items())


def _of_distribution(name: str) -> Iterable[EntryPoint]:
    try:
        installed: Distribution = distribution(name)
    except PackageNotFoundError:
        return ()
    return installed.entry_points


def _of_entry_points(entries: Iterable[EntryPoint]) -> list[Candidate]:
    return [
        Candidate(entry.group.removeprefix(GROUP), entry.name, entry.load)
        for entry in entries
        if entry.group.startswith(GROUP)
    ]


def _of_module(name: str) -> list[Candidate]:
    """Entry points into a module, and what the decorator `register` has registered in it."""
    entries = [entry for kind in plugins.KINDS for entry in entry_points(group=f"{GROUP}{kind}")]
    inside = _of_entry_points(entry for entry in entries if _inside(entry.module, name))
    if inside:
        return inside
    try:
        import_module(name)
    except ImportError as error:
        raise PluginError(
            f"There is no folder, no installed distribution and no module '{name}' ({error}); give one of these."
        ) from error
    classes = ((kind, known, plugins.get(kind, known)) for kind in plugins.KINDS for known in plugins.names(kind))
    return [
        Candidate(kind, known, partial(plugins.get, kind, known))
        for kind, known, cls in classes
        if _inside(cls.__module__, name)
    ]


def _inside(module: str, package: str) -> bool:
    return module == package or module.startswith(f"{package}.")
