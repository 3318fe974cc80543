"""The way of the data is one way: a stage imports only from stages before its own."""

import ast
from pathlib import Path

import pytest

import jerkbench

ORDER = [
    [
        "errors",
        "arrays",
        "files",
        "notices",
        "parameters",
        "random_streams",
        "renamed",
        "presets",
        "compilation",
    ],
    ["recording"],
    ["estimate"],
    ["geometry", "measurements"],
    ["timeline"],
    ["sums", "plugins.samples"],
    ["contracts"],
    ["kalman", "plugins.members"],
    ["kinematic"],
    ["inertial", "plugins", "simulation", "io"],
    ["datasets", "disturbances", "attitude"],
    ["filters", "adaptation"],
    ["engines", "evaluation"],
    ["plugins.checks", "report"],
    ["testing"],
    ["inspection"],
    ["jobs"],
    ["tuning"],
    ["audit", "suite", "hydra_app", "plugins.catalogue", "api", "fetching", "plugins.new"],
    ["verbs"],
    ["cli"],
    ["__main__"],
]
"""The modules of `plugins` beside the registry have places of their own: their names have a dot."""
STAGE = {name: place for place, names in enumerate(ORDER) for name in names}
PACKAGE = Path(jerkbench.__file__).parent


def part(*names):
    """The part of a module of the package, by the names on the way to it."""
    return ".".join(names[:2]) if names[0] == "plugins" and len(names) > 1 else names[0]


def part_of(path):
    return part(*path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jerkbench."):
            yield part(*node.module.split(".")[1:])
        elif isinstance(node, ast.ImportFrom) and node.module == "jerkbench":
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (part(*a.name.split(".")[1:]) for a in node.names if a.name.startswith("jerkbench."))


def test_every_part_of_the_package_has_its_place():
    parts = {part_of(path) for path in PACKAGE.rglob("*.py")}

    assert parts - {"__init__"} <= set(STAGE)


@pytest.mark.slow
def test_nothing_imports_from_a_later_stage():
    backwards = []
    for path in sorted(PACKAGE.rglob("*.py")):
        own = part_of(path)
        if own != "__init__":
            later = [name for name in imports(path) if name in STAGE and STAGE[name] > STAGE[own]]
            sideways = [n for n in imports(path) if n in STAGE and n != own and STAGE[n] == STAGE[own] > 0]
            backwards += [f"{path.relative_to(PACKAGE)} imports {name}" for name in later + sideways]

    assert backwards == []
