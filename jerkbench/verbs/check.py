"""`jerkbench check`: whether plugins keep their contracts, in sentences; its exit code tells a machine."""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.verbs.arguments import Verbs, add_verb

if TYPE_CHECKING:
    from jerkbench.authoring.check import Checked

BROKEN = 1
"""Exit code where a plugin does not keep its contract."""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    check = add_verb(
        verbs, "check", "say in sentences what the plugins of a package do not keep of their contracts", answer
    )
    check.add_argument("package", help="a folder with a pyproject.toml, an installed distribution, or a module")
    check.add_argument("--format", choices=tuple(WRITERS), default="text", help="default: text")


def answer(chosen: argparse.Namespace) -> None:
    """Print what was found in each plugin.

    Raises:
        PluginError: there is no such package, or it has no plugin.
        SystemExit: 1, where a plugin does not keep its contract.
    """
    from jerkbench.authoring.check import check_package

    checked = check_package(chosen.package)
    print(WRITERS[chosen.format](chosen.package, checked))
    if any(plugin.failed for plugin in checked):
        raise SystemExit(BROKEN)


def _text(_: str, checked: "Sequence[Checked]") -> str:
    lines = []
    for plugin in checked:
        title = f"{plugin.kind} {plugin.name}"
        lines += [f"{title}: {finding.severity}: {finding.sentence}" for finding in plugin.findings]
        lines += [] if plugin.failed else [f"{title}: keeps its contract."]
    return "\n".join(lines)


def _json(package: str, checked: "Sequence[Checked]") -> str:
    plugins = [
        {"kind": p.kind, "name": p.name, "ok": not p.failed, "findings": [f._asdict() for f in p.findings]}
        for p in checked
    ]
    return json.dumps({"package": package, "ok": all(p["ok"] for p in plugins), "plugins": plugins}, indent=2)


def _junit(package: str, checked: "Sequence[Checked]") -> str:
    from jerkbench.conformance.junit import Case, junit

    def sentences(plugin: "Checked", severity: str) -> tuple[str, ...]:
        return tuple(finding.sentence for finding in plugin.findings if finding.severity == severity)

    cases = [Case(p.kind, p.name, sentences(p, "error"), sentences(p, "notice")) for p in checked]
    return junit(f"jerkbench check {package}", cases).rstrip()


WRITERS: "Mapping[str, Callable[[str, Sequence[Checked]], str]]" = {"text": _text, "json": _json, "junit": _junit}
"""Formats of the answer."""
