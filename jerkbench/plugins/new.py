"""Help for who writes a plugin: a new package from templates, and its checks in a clean process."""

import dataclasses
import importlib.util
import keyword
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points, version
from pathlib import Path
from typing import Any, Literal, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError, article, require_known
from jerkbench.files import filled_template, write_text
from jerkbench.jobs.preflight import reason_of
from jerkbench.plugins.checks import CHECKS, STAGES
from jerkbench.plugins.requirements import changes_itself

# The plugins that a package offers: by its distribution, its module or its folder.

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


class PluginFinding(NamedTuple):
    """What is the matter with a plugin.

    Attributes:
        severity: an "error" keeps it out of sweeps or spoils their numbers; a "notice" costs time or a check.
        sentence: what was found, what it must be, what to do.
    """

    severity: Literal["error", "notice"]
    sentence: str


class CheckedPlugin(NamedTuple):
    """A plugin that was checked.

    Attributes:
        kind: of plugin.
        name: of the plugin.
        findings: what is the matter with it, or nothing.
    """

    kind: str
    name: str
    findings: tuple[PluginFinding, ...]

    @property
    def failed(self) -> bool:
        """Whether there is any error."""
        return any(finding.severity == "error" for finding in self.findings)


def check_package(package: str) -> list[CheckedPlugin]:
    """Run the conformance kit over every plugin of a folder, a distribution or a module.

    Raises:
        PluginError: there is no such package, or it has no plugin.
    """
    return [CheckedPlugin(c.kind, c.name, tuple(_findings(c))) for c in candidates(package)]


def _findings(candidate: Candidate) -> Iterator[PluginFinding]:
    try:
        cls = candidate.load()
    except Exception as error:  # noqa: BLE001 - whatever an author's module raises is a finding
        yield PluginFinding("error", f"It cannot be imported: {type(error).__name__}: {' '.join(str(error).split())}.")
        return
    try:
        plugins.register(candidate.kind, candidate.name)(cls)
    except PluginError as error:
        yield PluginFinding("error", str(error))
        return
    no = dataclasses.MISSING
    if lacking := [f.name for f in dataclasses.fields(cls) if f.default is no and f.default_factory is no]:
        text = f"{cls.__name__} has no default for {', '.join(lacking)}, so it was not tried; call check_plugin."
        yield PluginFinding("notice", text)
        return
    try:
        plugin = plugins.create(candidate.kind, {"name": candidate.name})
    except Exception as error:  # noqa: BLE001 - as above
        yield PluginFinding("error", str(error) if isinstance(error, PluginError) else _raised(cls, error))
        return
    sentences = [sentence for check in (*STAGES, CHECKS[candidate.kind]) if (sentence := _complaint(check, plugin))]
    yield from (PluginFinding("error", sentence) for sentence in sentences)
    if candidate.kind == "adaptation" and not sentences:
        from jerkbench.kinematic.plugin_call import obstacle  # what it imports takes half a second

        if reason := obstacle(plugin):
            text = f"{cls.__name__} cannot be compiled and runs on the engine filterpy, many times slower: {reason}"
            yield PluginFinding("notice", text)


def _complaint(check: Callable[[Any], None], plugin: Any) -> str:  # noqa: ANN401 - a plugin of any kind
    try:
        check(plugin)
    except AssertionError as error:
        return str(error)
    except dataclasses.FrozenInstanceError as error:
        return changes_itself(plugin, error)
    except Exception as error:  # noqa: BLE001 - whatever a plugin raises is a finding
        return _raised(type(plugin), error)
    return ""


def _raised(cls: type, error: Exception) -> str:
    return f"{cls.__name__} raises {reason_of(error)}."


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
    files = {
        f"{name}.py": f"{kind}.py.jinja",
        f"test_{name}.py": "test.py.jinja",
        "pyproject.toml": "pyproject.toml.jinja",
        "README.md": "README.md.jinja",
    }
    for file, template in files.items():
        write_text(folder / file, _filled(template, kind, name))
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


def _filled(template: str, kind: str, name: str) -> str:
    example = EXAMPLES[kind]
    return filled_template(
        Path(__file__).parent / "templates" / template,
        kind=kind,
        name=name,
        group=example.group,
        group_word=f"{article(example.group)}_{example.group}",
        article=article(kind).capitalize(),
        title=example.title,
        usage=f"jerkbench run -m {example.usage.format(name)} seeds=3",
        class_name=class_name(name),
        distribution=name.replace("_", "-"),
        version=version("jerkbench"),
    )
