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
        "notebook",
        "notices",
        "parameters",
        "plain",
        "random_streams",
        "removed",
        "renamed",
        "presets",
        "yaml_files",
        "compilation",
        "kalman",
    ],
    ["recording", "estimate"],
    ["geometry", "measurements"],
    ["timeline"],
    ["sums"],
    ["contracts"],
    ["optional"],
    ["kinematic"],
    ["inertial", "linear", "plugins", "simulation", "io", "traces"],
    ["datasets", "disturbances", "attitude"],
    ["filters", "adaptation"],
    ["engines", "evaluation"],
    ["conformance"],
    ["testing", "report"],
    ["inspection"],
    ["jobs"],
    ["results"],
    ["tuning"],
    ["audit", "suite", "hydra_app", "catalogue", "api", "fetching", "authoring"],
    ["verbs"],
    ["cli"],
    ["__main__"],
]
STAGE = {name: place for place, names in enumerate(ORDER) for name in names}
PACKAGE = Path(jerkbench.__file__).parent


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jerkbench."):
            yield node.module.split(".")[1]
        elif isinstance(node, ast.ImportFrom) and node.module == "jerkbench":
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (a.name.split(".")[1] for a in node.names if a.name.startswith("jerkbench."))


def test_every_part_of_the_package_has_its_place():
    parts = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in PACKAGE.rglob("*.py")}

    assert parts - {"__init__"} <= set(STAGE)


@pytest.mark.slow
def test_nothing_imports_from_a_later_stage():
    backwards = []
    for path in sorted(PACKAGE.rglob("*.py")):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if own != "__init__":
            later = [name for name in imports(path) if name in STAGE and STAGE[name] > STAGE[own]]
            sideways = [n for n in imports(path) if n in STAGE and n != own and STAGE[n] == STAGE[own] > 0]
            backwards += [f"{path.relative_to(PACKAGE)} imports {name}" for name in later + sideways]

    assert backwards == []
