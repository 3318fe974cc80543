"""Tools for authors of plugins, which create a new package from templates or check the plugins of a package."""

import dataclasses
import importlib.util
import keyword
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, version
from pathlib import Path

from jerkbench import plugins
from jerkbench.errors import PluginError, article, require_known
from jerkbench.files import filled_template, write_text
from jerkbench.jobs.job import reason_of
from jerkbench.plugins.checks import class_problems, problem

# Functions that check a package.

GROUP = "jerkbench."
"""Prefix of the groups of entry points that contain plugins."""

SOURCES = ("", "src")
"""Subfolders of a package in which its modules may be."""


def entry_points_of(package: str) -> list[EntryPoint]:
    """Return the entry points of the plugins in a package: a folder with a pyproject.toml, or a distribution.

    Raises:
        PluginError: The package is unknown, or it has no plugin.
    """
    try:
        found = list(_of_folder(Path(package)) if Path(package).is_dir() else distribution(package).entry_points)
    except PackageNotFoundError:
        found = []
    found = [entry for entry in found if entry.group.startswith(GROUP)]
    if not found:
        raise PluginError(
            f'{package} has no plugin. Add an entry point NAME = "MODULE:CLASS" to the section'
            ' [project.entry-points."jerkbench.KIND"] of its pyproject.toml, and install the package again.'
        )
    return found


def _of_folder(folder: Path) -> Iterator[EntryPoint]:
    """Yield the entry points in the pyproject.toml of a folder, and add the folder to the start of the module path."""
    project = folder / "pyproject.toml"
    if not project.is_file():
        raise PluginError(f"{folder} has no pyproject.toml; give the folder or the name of a package.")
    sys.path[:0] = [str((folder / source).resolve()) for source in SOURCES if (folder / source).is_dir()]
    try:
        groups = tomllib.loads(project.read_text(encoding="utf-8")).get("project", {}).get("entry-points", {})
    except tomllib.TOMLDecodeError as error:
        raise PluginError(f"{project} cannot be read: {error}.") from error
    for group, names in groups.items():
        yield from (EntryPoint(name, value, group) for name, value in names.items())


def check_package(package: str) -> list[tuple[str, str, list[str], list[str]]]:
    """Check every plugin of a package, and return the kind, the name, the failures and the notes of each plugin.

    The package is a folder or a distribution. A failure means that the plugin cannot run or that its results are
    wrong. A note means that the plugin runs slowly or could not be checked.

    Raises:
        PluginError: The package is unknown, or it has no plugin.
    """
    entries = [(entry.group.removeprefix(GROUP), entry) for entry in entry_points_of(package)]
    return [(kind, entry.name, *_findings(kind, entry)) for kind, entry in entries]


def _findings(kind: str, entry: EntryPoint) -> tuple[list[str], list[str]]:
    try:
        cls = entry.load()
    except Exception as error:  # noqa: BLE001 - the module may raise any exception
        reason = " ".join(str(error).split())
        return [f"It cannot be imported: {type(error).__name__}: {reason}."], []
    try:
        plugins.register(kind, entry.name)(cls)
        parameters, missing = dataclasses.fields(cls), dataclasses.MISSING
        if required := [f.name for f in parameters if f.default is missing and f.default_factory is missing]:
            names = ", ".join(required)
            return [], [f"{cls.__name__} has no default for {names}, so it was not tried; call check_plugin."]
        plugin = plugins.create(kind, {"name": entry.name})
        errors = [*class_problems(kind, plugin), *filter(None, [problem(kind, plugin)])]
    except PluginError as error:
        return [str(error)], []
    except Exception as error:  # noqa: BLE001 - the plugin may raise any exception
        return [f"{cls.__name__} raises {reason_of(error)}."], []
    if errors or kind != "adaptation":
        return errors, []
    from jerkbench.kinematic.rules import obstacle  # importing this module takes half a second

    slow = f"{cls.__name__} cannot be compiled and runs on the engine filterpy, many times slower"
    return [], [f"{slow}: {reason}"] if (reason := obstacle(plugin)) else []


# Functions that create a new package with one plugin.


EXAMPLES: Mapping[str, tuple[str, str]] = {
    "dataset": ("A straight drive at a constant speed.", "dataset={0} filter=baseline,jerk"),
    "disturbance": ("Moves the fixes from one moment on.", "disturbance=none,{0}"),
    "attitude": ("Level, with the yaw of the gyro only.", "attitude=tilt,{0}"),
    "filter": ("Position and velocity, driven by the measured acceleration.", "filter=baseline,{0}"),
    "estimator": ("Holds the last fix.", "filter=gnss_only,{0}"),
    "adaptation": ("Scales R if the innovation is too large.", "adaptation=none,{0}"),
    "metric": ("Fraction of the rows with a larger position error than a limit.", "filter=baseline,jerk"),
}
"""The examples, by the kind that is given to `jerkbench new`.

An example is the first line of the docstring of the plugin, and the arguments of a sweep with the plugin, in which {0}
is replaced by the name of the plugin.
"""

PLUGIN_TEMPLATES = Path(__file__).parent / "templates"
_NAME = re.compile(r"[a-z][a-z0-9_]*")


def write_package(kind: str, name: str, folder: Path) -> list[Path]:
    """Write a package with one plugin, and return the paths of its files.

    Args:
        kind: Kind of the plugin, or ``estimator`` for a filter that processes complete recordings.
        name: Name of the plugin and of its module.
        folder: Folder of the package, which must not exist or must be empty.

    Raises:
        PluginError: The kind is unknown, the name is invalid or already used, or the folder is not empty.
    """
    require_known("kind of plugin to begin with", kind, EXAMPLES)
    group, (title, usage) = "filter" if kind == "estimator" else kind, EXAMPLES[kind]
    _require_name(group, name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise PluginError(f"{folder} already exists; give another folder: --out FOLDER.")
    values = {
        "kind": kind,
        "name": name,
        "group": group,
        "group_word": f"{article(group)}_{group}",
        "article": article(kind).capitalize(),
        "title": title,
        "usage": f"jerkbench run -m {usage.format(name)} seeds=3",
        "class_name": class_name(name),
        "distribution": name.replace("_", "-"),
        "version": version("jerkbench"),
    }
    files = {f"{name}.py": kind + ".py", f"test_{name}.py": "test.py"} | {f: f for f in ("pyproject.toml", "README.md")}
    for file, template in files.items():
        write_text(folder / file, filled_template(PLUGIN_TEMPLATES / f"{template}.jinja", **values))
    return [folder / file for file in files]


def class_name(name: str) -> str:
    """Return the class name for the name of a plugin.

    >>> class_name("student_t2")
    'StudentT2'
    """
    return "".join(part.capitalize() for part in name.split("_"))


def _require_name(group: str, name: str) -> None:
    if not _NAME.fullmatch(name) or keyword.iskeyword(name) or keyword.issoftkeyword(name):
        raise PluginError(f"Invalid name '{name}'; use small letters, digits and _, for example my_{group}.")
    if name in plugins.names(group):
        raise PluginError(f"The name '{name}' is already used by {article(group)} {group}; choose another name.")
    if importlib.util.find_spec(name) is not None:
        raise PluginError(f"The name '{name}' is already used by a Python module; choose another name.")
