"""A package for a plugin of one's own, to begin from."""

import importlib.util
import keyword
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError, article, unknown
from jerkbench.files import write_text


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

NAME = re.compile(r"[a-z][a-z0-9_]*")


def write_package(kind: str, name: str, folder: Path) -> list[Path]:
    """Write a package with one plugin; returns its files.

    Args:
        kind: of the plugin, or ``estimator``.
        name: of the plugin and of its module.
        folder: of the package; must not exist yet, or be empty.

    Raises:
        PluginError: no such kind, no possible name, one that is taken, or there is something in the folder.
    """
    if kind not in EXAMPLES:
        raise PluginError(unknown("kind of plugin to begin with", kind, EXAMPLES))
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
    if not NAME.fullmatch(name) or keyword.iskeyword(name) or keyword.issoftkeyword(name):
        raise PluginError(f"'{name}' cannot be the name; write small letters, digits and _, for example my_{group}.")
    if name in plugins.names(group):
        raise PluginError(f"There is {article(group)} {group} '{name}' already; choose another name than that.")
    if importlib.util.find_spec(name) is not None:
        raise PluginError(f"There is a Python module '{name}' already; choose another name than that.")


def _filled(template: str, kind: str, name: str) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    example = EXAMPLES[kind]
    environment = Environment(  # noqa: S701 - it writes Python and TOML, no HTML
        loader=PackageLoader("jerkbench.authoring"), undefined=StrictUndefined, keep_trailing_newline=True
    )
    return environment.get_template(template).render(
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
