"""The verbs of plugins: `list`, `show`, `new`, `check`."""

import argparse
from pathlib import Path

from jerkbench.cli.arguments import ANSWER_FORMAT, argument, output, print_json, verb


@verb(argument("kind", nargs="?", help="dataset, disturbance, attitude, filter, adaptation, ..."), ANSWER_FORMAT)
def list_verb(chosen: argparse.Namespace) -> None:
    """List all plugins and presets, or those of one kind.

      jerkbench list adaptation
      jerkbench list metric --format json

    Raises:
        PluginError: no such kind.
    """
    from jerkbench.plugins.catalogue import list_text, listed_json

    if chosen.format == "json":
        print_json(listed_json(chosen.kind))
    else:
        print(list_text(chosen.kind))


@verb(
    argument("kind", help="dataset, disturbance, attitude, filter, adaptation, ...; may be left out"),
    argument("name", nargs="?"),
    ANSWER_FORMAT,
)
def show_verb(chosen: argparse.Namespace) -> None:
    """Print equations, parameters, defaults and source of one plugin or preset.

      jerkbench show adaptation mtf
      jerkbench show filter jerk --format json

    Raises:
        PluginError: there is none of that name.
    """
    from jerkbench.plugins.catalogue import kind_of, show_text, shown_json

    if chosen.name is None and "=" in chosen.kind:  # as `run` takes it
        chosen.kind, _, chosen.name = chosen.kind.partition("=")
    if chosen.name is None:
        chosen.kind, chosen.name = kind_of(chosen.kind), chosen.kind
    if chosen.format == "json":
        print_json(shown_json(chosen.kind, chosen.name))
    else:
        print(show_text(chosen.kind, chosen.name))


@verb(
    argument("kind", help="dataset, disturbance, attitude, filter, estimator, adaptation or metric"),
    argument("name", help="of the plugin and its module, for example my_rule"),
    argument("--out", type=output, metavar="FOLDER", help="where it goes (default: a folder of its name, here)"),
)
def new_verb(chosen: argparse.Namespace) -> None:
    """Write a package with a plugin of your own: class, entry point, test, README.

      jerkbench new adaptation my_rule
      jerkbench new filter my_model --out packages/my_model

    Raises:
        PluginError: no such kind, no possible name, one that is taken, or there is something in the folder.
    """
    from jerkbench.plugins.new import write_package

    for path in write_package(chosen.kind, chosen.name, chosen.out or Path(chosen.name)):
        print(path)


BROKEN = 1
"""Exit code where a plugin does not keep its contract."""


@verb(
    argument("package", help="a folder with a pyproject.toml, an installed distribution, or a module"),
    argument("--format", choices=("text", "json", "junit"), default="text", help="default: text"),
)
def check_verb(chosen: argparse.Namespace) -> None:
    """Check whether the plugins of a package keep their contracts.

      jerkbench check my_rule
      jerkbench check packages/my_model --format junit

    Raises:
        PluginError: there is no such package, or it has no plugin.
        SystemExit: 1, where a plugin does not keep its contract.
    """
    from jerkbench.files import junit
    from jerkbench.plugins.new import check_package

    checked = check_package(chosen.package)
    found = [[("error", e) for e in case.failures] + [("notice", n) for n in case.notes] for case in checked]
    ok = not any(case.failures for case in checked)
    if chosen.format == "junit":
        print(junit(f"jerkbench check {chosen.package}", checked).rstrip())
    elif chosen.format == "json":
        findings = [[{"severity": severity, "sentence": message} for severity, message in of] for of in found]
        plugins = [
            {"kind": case.group, "name": case.name, "ok": not case.failures, "findings": of}
            for case, of in zip(checked, findings, strict=True)
        ]
        print_json({"package": chosen.package, "ok": ok, "plugins": plugins})
    else:
        for case, of in zip(checked, found, strict=True):
            lines = [f"{severity}: {message}" for severity, message in of]
            for line in [*lines, *["keeps its contract."] * (not case.failures)]:
                print(f"{case.group} {case.name}: {line}")
    if not ok:
        raise SystemExit(BROKEN)
