"""Help for who writes a plugin: a new package from templates, and its checks in a clean process."""

import dataclasses
import importlib.util
import keyword
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points, version
from pathlib import Path
from typing import NamedTuple

from jerkbench import plugins
from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, article, require_known
from jerkbench.files import JunitCase, filled_template, write_text
from jerkbench.jobs.preflight import reason_of
from jerkbench.plugins.checks import class_problems, problem

# The check of a package

GROUP = "jerkbench."
"""Start of the names of groups of entry points that are plugins."""

SOURCES = ("", "src")
"""Where the modules of a package may be in its folder."""


def entry_points_of(package: str) -> list[EntryPoint]:
    """Return the plugins of ``package``: a folder with a pyproject.toml, a distribution, or a module.

    Raises:
        PluginError: there is no such package, or it has no plugin.
    """
    try:
        found = list(_of_folder(Path(package)) if Path(package).is_dir() else distribution(package).entry_points)
    except PackageNotFoundError:
        found = []
    found = [entry for entry in found if entry.group.startswith(GROUP)]
    if not found and not Path(package).is_dir():
        found = _of_module(package)
    if not found:
        raise PluginError(
            f'{package} has no plugin: write an entry point, [project.entry-points."jerkbench.KIND"] with NAME = '
            '"MODULE:CLASS", into its pyproject.toml, and install it again.'
        )
    return found


def _of_folder(folder: Path) -> Iterator[EntryPoint]:
    """The entry points of its pyproject.toml. Its modules are imported before others from now on."""
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


def _of_module(module: str) -> list[EntryPoint]:
    """Entry points into a module, or else the plugins that the decorator `register` has registered in it."""

    def inside(entries: Iterable[EntryPoint]) -> list[EntryPoint]:
        return [entry for entry in entries if f"{entry.module}.".startswith(f"{module}.")]

    if found := inside(entry for kind in plugins.KINDS for entry in entry_points(group=f"{GROUP}{kind}")):
        return found
    try:
        import_module(module)
    except ImportError as error:
        raise PluginError(
            f"There is no folder, no installed distribution and no module '{module}' ({error}); give one of these."
        ) from error
    known = ((kind, name, plugins.get(kind, name)) for kind in plugins.KINDS for name in plugins.names(kind))
    return inside(EntryPoint(name, f"{c.__module__}:{c.__qualname__}", f"{GROUP}{kind}") for kind, name, c in known)


def check_package(package: str) -> list[JunitCase]:
    """Check every plugin of a folder, a distribution or a module.

    Failures: the plugin cannot run, or its results are wrong. Notes: it runs, but slowly or unchecked.

    Raises:
        PluginError: there is no such package, or it has no plugin.
    """
    entries = [(entry.group.removeprefix(GROUP), entry) for entry in entry_points_of(package)]
    return [JunitCase(kind, entry.name, *_findings(kind, entry)) for kind, entry in entries]


def _findings(kind: str, entry: EntryPoint) -> tuple[list[str], list[str]]:
    """Return the errors and the notices about a plugin."""
    try:
        cls = entry.load()
    except Exception as error:  # noqa: BLE001 - the module of an author may raise anything
        reason = " ".join(str(error).split())
        return [f"It cannot be imported: {type(error).__name__}: {reason}."], []
    try:
        plugins.register(kind, entry.name)(cls)
        no = dataclasses.MISSING
        if required := [f.name for f in dataclasses.fields(cls) if f.default is no and f.default_factory is no]:
            names = ", ".join(required)
            return [], [f"{cls.__name__} has no default for {names}, so it was not tried; call check_plugin."]
        plugin = plugins.create(kind, {"name": entry.name})
        errors = [*class_problems(kind, plugin), *filter(None, [problem(kind, plugin)])]
    except PluginError as error:
        return [str(error)], []
    except Exception as error:  # noqa: BLE001 - a plugin may raise anything
        return [f"{cls.__name__} raises {reason_of(error)}."], []
    reason = _why_not_compiled(plugin) if kind == "adaptation" and not errors else ""
    slow = f"{cls.__name__} cannot be compiled and runs on the engine filterpy, many times slower: {reason}"
    return errors, [slow] if reason else []


def _why_not_compiled(plugin: Adaptation) -> str:
    from jerkbench.kinematic.plugin_call import obstacle  # its import takes half a second

    return obstacle(plugin)


# A package for a plugin of one's own, to begin from.


class Example(NamedTuple):
    """The plugin that the package of a kind begins with.

    Attributes:
        group: of its entry point; an estimator stands in that of the filters.
        title: what it does, in a sentence.
        usage: a sweep with it, with its name for {0}.
    """

    group: str
    title: str
    usage: str


EXAMPLES: Mapping[str, Example] = {
    "dataset": Example("dataset", "A straight drive at a constant speed.", "dataset={0} filter=baseline,jerk"),
    "disturbance": Example("disturbance", "Moves the fixes from one moment on.", "disturbance=none,{0}"),
    "attitude": Example("attitude", "Level, with the yaw of the gyro alone.", "attitude=tilt,{0}"),
    "filter": Example("filter", "Position and velocity, driven by the measured acceleration.", "filter=baseline,{0}"),
    "estimator": Example("filter", "Holds the last fix.", "filter=gnss_only,{0}"),
    "adaptation": Example(
        "adaptation", "Inflates R as a whole where the innovation is too large.", "adaptation=none,{0}"
    ),
    "metric": Example("metric", "Share of the rows with a larger position error than a limit.", "filter=baseline,jerk"),
}
"""By what one says to `jerkbench new`."""

TEMPLATES = Path(__file__).parent / "templates"
_NAME = re.compile(r"[a-z][a-z0-9_]*")


def write_package(kind: str, name: str, folder: Path) -> list[Path]:
    """Write a package with one plugin; returns its files.

    Args:
        kind: of the plugin, or ``estimator``.
        name: of the plugin and of its module.
        folder: of the package; must not exist yet, or be empty.

    Raises:
        PluginError: no such kind, no possible name, one that is taken, or there is something in the folder.
    """
    require_known("kind of plugin to begin with", kind, EXAMPLES)
    _require_name(EXAMPLES[kind].group, name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise PluginError(f"{folder} is there already; give another folder: --out FOLDER.")
    example = EXAMPLES[kind]
    values = {
        "kind": kind,
        "name": name,
        "group": example.group,
        "group_word": f"{article(example.group)}_{example.group}",
        "article": article(kind).capitalize(),
        "title": example.title,
        "usage": f"jerkbench run -m {example.usage.format(name)} seeds=3",
        "class_name": class_name(name),
        "distribution": name.replace("_", "-"),
        "version": version("jerkbench"),
    }
    files = {f"{name}.py": kind + ".py", f"test_{name}.py": "test.py"} | {f: f for f in ("pyproject.toml", "README.md")}
    for file, template in files.items():
        write_text(folder / file, filled_template(TEMPLATES / f"{template}.jinja", **values))
    return [folder / file for file in files]


def class_name(name: str) -> str:
    """Return the name of a plugin as that of a class.

    >>> class_name("student_t2")
    'StudentT2'
    """
    return "".join(word.capitalize() for word in name.split("_"))


def _require_name(group: str, name: str) -> None:
    if not _NAME.fullmatch(name) or keyword.iskeyword(name) or keyword.issoftkeyword(name):
        raise PluginError(f"'{name}' cannot be the name; write small letters, digits and _, for example my_{group}.")
    if name in plugins.names(group):
        raise PluginError(f"There is {article(group)} {group} '{name}' already; choose another name than that.")
    if importlib.util.find_spec(name) is not None:
        raise PluginError(f"There is a Python module '{name}' already; choose another name than that.")
