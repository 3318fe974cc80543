"""The house keeps its order: one name is one thing, a concept stands in one file, and nothing grows back.

The bounds are what is there today, where that is more than it should be: they may be lowered, and are never raised to
let something through.
"""

import ast
import io
import tokenize
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import jerkbench

ROOT = Path(jerkbench.__file__).parents[1]

MAX_FILE_LINES = 500
"""Lines of a file."""

MAX_MODULES, MAX_FOLDERS = 133, 23
"""Modules, but for those of plugins, which may become more; and folders."""
MAX_CODE = {
    "campaign": 1546,
    "cli": 809,
    "compilation": 427,
    "evaluation": 962,
    "hydra_app": 715,
    "hydra_plugins": 15,
    "inertial": 1029,
    "inspection": 1755,
    "io": 2557,
    "jerkbench": 1680,
    "jobs": 1675,
    "kinematic": 1242,
    "plugins": 735,
    "report": 2601,
    "simulation": 586,
}
"""Lines of code of each package without docstrings, comments, blank lines, imports and plugins. They may only fall."""
MAX_LONE = 7
"""Modules that one other module imports; the aim is none."""

DOUBLES = {"anywhere", "each_run", "select"}
"""Names that stand for several things: these functions are one operation on numbers and on vectors of them."""

PLUGINS = ("adaptation", "attitude", "datasets", "disturbances", "engines", "evaluation/metrics", "filters")
"""Folders whose modules are found by their names."""


class Module(NamedTuple):
    """A module of the package."""

    name: str
    path: Path
    text: str
    tree: ast.Module


@cache
def modules():
    paths = [path for folder in ("jerkbench", "hydra_plugins") for path in sorted((ROOT / folder).rglob("*.py"))]
    names = (".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths)
    texts = [path.read_text(encoding="utf-8") for path in paths]
    return [Module(*entry, ast.parse(entry[2])) for entry in zip(names, paths, texts, strict=True)]


@cache
def homes():
    """The modules in which each public name stands."""
    found = defaultdict(set)
    for module in modules():
        for node in module.tree.body:
            named = [node] if isinstance(node, ast.ClassDef | ast.FunctionDef) else getattr(node, "targets", [])
            named = [node.target] if isinstance(node, ast.AnnAssign) else named
            named = [one for target in named for one in getattr(target, "elts", [target])]
            for name in (getattr(one, "name", None) or getattr(one, "id", "_") for one in named):
                if not name.startswith("_"):
                    found[name].add(module.name)
    return found


def doubles():
    return {name for name, where in homes().items() if len(where) > 1}


def lines_of_code(module):
    """The lines on which a token stands that is neither a docstring nor part of an import."""
    other = [node for node in ast.walk(module.tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    other += [
        node
        for node in ast.walk(module.tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    silent = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    tokens = (
        token for token in tokenize.generate_tokens(io.StringIO(module.text).readline) if token.type not in silent
    )
    lines = {line for token in tokens for line in range(token.start[0], token.end[0] + 1)}
    return len(lines - {line for node in other for line in range(node.lineno, node.end_lineno + 1)})


@cache
def importers():
    """The modules that import each module, anywhere in their text."""
    names = {module.name for module in modules()}
    found = defaultdict(set)
    for module in modules():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                wanted = [f"{node.module}.{alias.name}" for alias in node.names]
                imported = [name if name in names else node.module for name in wanted]
            else:
                imported = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in set(imported) - {module.name}:
                found[name].add(module.name)
    return found


def is_plugin(module):
    return any(module.path.is_relative_to(ROOT / "jerkbench" / folder) for folder in PLUGINS)


def lone_modules():
    """Modules with one importer; those that a verb or `cli` loads when it is asked for them have their reason."""
    lone = {module.name: importers()[module.name] for module in modules() if not is_plugin(module)}
    late = ("jerkbench.cli", "jerkbench.__main__")
    lone.pop("jerkbench.api")  # which is public
    return sorted(name for name, by in lone.items() if len(by) == 1 and not next(iter(by)).startswith(late))


def test_no_public_name_is_that_of_another_thing():
    assert doubles() <= DOUBLES, f"give these names of their own: {sorted(doubles() - DOUBLES)}"


def test_names_that_are_no_longer_double_are_not_excused():
    assert doubles() >= DOUBLES, f"strike from DOUBLES: {sorted(DOUBLES - doubles())}"


def test_a_file_is_no_longer_than_a_concept():
    long = {
        str(module.path): module.text.count("\n") for module in modules() if module.text.count("\n") > MAX_FILE_LINES
    }

    assert long == {}


def test_files_and_folders_become_no_more():
    assert sum(not is_plugin(module) for module in modules()) <= MAX_MODULES
    assert len({module.path.parent for module in modules()}) <= MAX_FOLDERS


def package(module):
    first, _, rest = module.name.partition(".")
    folder = rest.partition(".")[0]
    return folder if first == "jerkbench" and folder and (ROOT / first / folder).is_dir() else first


def test_no_package_grows():
    counts = defaultdict(int)
    for module in modules():
        if not is_plugin(module):
            counts[package(module)] += lines_of_code(module)

    assert {name: count for name, count in counts.items() if count > MAX_CODE.get(name, 0)} == {}


def test_modules_with_one_importer_become_no_more():
    assert len(lone_modules()) <= MAX_LONE, lone_modules()
