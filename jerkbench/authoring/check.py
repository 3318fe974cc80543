"""The conformance kit over the plugins of a package; each finding is a sentence."""

import dataclasses
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points
from pathlib import Path
from typing import Any, Literal, NamedTuple

from jerkbench import plugins
from jerkbench.conformance.plugin import CHECKS, STAGES
from jerkbench.conformance.requirements import changes_itself
from jerkbench.errors import PluginError
from jerkbench.jobs.preflight import reason_of

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
    yield from _of_class(candidate, cls)


def _of_class(candidate: Candidate, cls: type) -> Iterator[PluginFinding]:
    lacking = [f.name for f in dataclasses.fields(cls) if _has_no_default(f)]
    if lacking:
        names = ", ".join(lacking)
        yield PluginFinding(
            "notice", f"{cls.__name__} has no default for {names}, so it was not tried; call check_plugin."
        )
        return
    try:
        plugin = plugins.create(candidate.kind, {"name": candidate.name})
    except Exception as error:  # noqa: BLE001 - as above
        yield PluginFinding("error", str(error) if isinstance(error, PluginError) else _raised(cls, error))
        return
    yield from _of_plugin(candidate.kind, plugin)


def _of_plugin(kind: str, plugin: Any) -> Iterator[PluginFinding]:  # noqa: ANN401 - a plugin of any kind
    sentences = [sentence for check in (*STAGES, CHECKS[kind]) if (sentence := _complaint(check, plugin))]
    yield from (PluginFinding("error", sentence) for sentence in sentences)
    if kind != "adaptation" or sentences:
        return
    from jerkbench.kinematic.plugin_call import obstacle  # what it imports takes half a second

    if reason := obstacle(plugin):
        yield PluginFinding(
            "notice",
            f"{type(plugin).__name__} cannot be compiled and runs on the engine filterpy, many times slower: {reason}",
        )


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


def _has_no_default(f: "dataclasses.Field[Any]") -> bool:
    return f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
