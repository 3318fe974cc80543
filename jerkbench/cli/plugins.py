"""The commands for plugins: `list`, `show`, `new`, `check`."""

import argparse
from pathlib import Path

from jerkbench.cli.arguments import OUTPUT_FORMAT, argument, command, print_json
from jerkbench.errors import FAILED


@command(argument("kind", nargs="?", help="dataset, disturbance, attitude, filter, adaptation, ..."), OUTPUT_FORMAT)
def list_command(arguments: argparse.Namespace) -> None:
    """List all plugins and presets, or the plugins and presets of one kind.

      jerkbench list adaptation
      jerkbench list metric --format json

    Raises:
        PluginError: The kind is unknown.
    """
    from jerkbench.plugins.catalogue import list_text, listed_json

    if arguments.format == "json":
        print_json(listed_json(arguments.kind))
    else:
        print(list_text(arguments.kind))


@command(
    argument("kind", help="dataset, disturbance, attitude, filter, adaptation, ..."),
    argument("name"),
    OUTPUT_FORMAT,
)
def show_command(arguments: argparse.Namespace) -> None:
    """Print the equations, parameters, defaults and source of a plugin or preset.

      jerkbench show adaptation mtf
      jerkbench show filter jerk --format json

    Raises:
        PluginError: The name is unknown.
    """
    from jerkbench.plugins.catalogue import show_text, shown_json

    if arguments.format == "json":
        print_json(shown_json(arguments.kind, arguments.name))
    else:
        print(show_text(arguments.kind, arguments.name))


@command(
    argument("kind", help="dataset, disturbance, attitude, filter, estimator, adaptation or metric"),
    argument("name", help="name of the plugin and its module, for example my_rule"),
    argument("--out", type=Path, metavar="FOLDER", help="folder of the package (default: ./NAME)"),
)
def new_command(arguments: argparse.Namespace) -> None:
    """Write a package for a new plugin: class, entry point, test, README.

      jerkbench new adaptation my_rule
      jerkbench new filter my_model --out packages/my_model

    Raises:
        PluginError: The kind is unknown, the name is invalid or in use, or the folder is not empty.
    """
    from jerkbench.plugins.new import write_package

    for path in write_package(arguments.kind, arguments.name, arguments.out or Path(arguments.name)):
        print(path)


@command(
    argument("package", help="a folder with a pyproject.toml, or an installed distribution"),
)
def check_command(arguments: argparse.Namespace) -> None:
    """Check whether the plugins of a package satisfy their contracts.

      jerkbench check my_rule
      jerkbench check packages/my_model

    Raises:
        PluginError: The package does not exist, or it has no plugins.
        SystemExit: 1 if a plugin does not satisfy its contract.
    """
    from jerkbench.plugins.new import check_package

    checked = check_package(arguments.package)
    for kind, name, failures, notes in checked:
        lines = [*(f"error: {message}" for message in failures), *(f"notice: {message}" for message in notes)]
        for line in lines if failures else [*lines, "satisfies its contract."]:
            print(f"{kind} {name}: {line}")
    if any(failures for _, _, failures, _ in checked):
        raise SystemExit(FAILED)
