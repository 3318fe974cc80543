"""The conformance kit over the plugins of a package; each finding is a sentence."""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, Literal, NamedTuple

from jerkbench import plugins
from jerkbench.authoring.candidates import Candidate, candidates
from jerkbench.conformance.plugin import CHECKS, STAGES
from jerkbench.conformance.require import changes_itself
from jerkbench.engines.compiled_engine import obstacle
from jerkbench.errors import PluginError
from jerkbench.execution.plugin_errors import reason_of


class Finding(NamedTuple):
    """What is the matter with a plugin.

    Attributes:
        severity: an "error" keeps it out of sweeps or spoils their numbers; a "notice" costs time or a check.
        sentence: what was found, what it must be, what to do.
    """

    severity: Literal["error", "notice"]
    sentence: str


class Checked(NamedTuple):
    """A plugin that was checked.

    Attributes:
        kind: of plugin.
        name: of the plugin.
        findings: what is the matter with it, or nothing.
    """

    kind: str
    name: str
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> bool:
        """Whether there is any error."""
        return any(finding.severity == "error" for finding in self.findings)


def check_package(package: str) -> list[Checked]:
    """Run the conformance kit over every plugin of a folder, a distribution or a module.

    Raises:
        PluginError: there is no such package, or it has no plugin.
    """
    return [Checked(c.kind, c.name, tuple(_findings(c))) for c in candidates(package)]


def _findings(candidate: Candidate) -> Iterator[Finding]:
    try:
        cls = candidate.load()
    except Exception as error:  # noqa: BLE001 - whatever an author's module raises is a finding
        yield Finding("error", f"It cannot be imported: {type(error).__name__}: {' '.join(str(error).split())}.")
        return
    try:
        plugins.register(candidate.kind, candidate.name)(cls)
    except PluginError as error:
        yield Finding("error", str(error))
        return
    yield from _of_class(candidate, cls)


def _of_class(candidate: Candidate, cls: type) -> Iterator[Finding]:
    lacking = [f.name for f in dataclasses.fields(cls) if _has_no_default(f)]
    if lacking:
        names = ", ".join(lacking)
        yield Finding("notice", f"{cls.__name__} has no default for {names}, so it was not tried; call check_plugin.")
        return
    try:
        plugin = plugins.create(candidate.kind, {"name": candidate.name})
    except Exception as error:  # noqa: BLE001 - as above
        yield Finding("error", str(error) if isinstance(error, PluginError) else _raised(cls, error))
        return
    yield from _of_plugin(candidate.kind, plugin)


def _of_plugin(kind: str, plugin: Any) -> Iterator[Finding]:  # noqa: ANN401 - a plugin of any kind
    sentences = [sentence for check in (*STAGES, CHECKS[kind]) if (sentence := _complaint(check, plugin))]
    yield from (Finding("error", sentence) for sentence in sentences)
    if kind == "adaptation" and not sentences and (reason := obstacle(plugin)):
        yield Finding(
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
