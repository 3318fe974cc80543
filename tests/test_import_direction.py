"""Data flow in one direction: a stage imports only from earlier stages."""

import ast
from functools import cache
from pathlib import Path

import jerkbench

ORDER = [
    [
        "errors",
        "arrays",
        "files",
        "parameters",
        "random_streams",
        "renamed",
        "presets",
        "compilation",
    ],
    ["recording", "kalman"],
    ["estimate", "geometry"],
    ["timeline"],
    ["contracts", "plugins.samples"],
    ["numpy_run", "kinematic", "plugins"],
    ["inertial", "simulation", "io"],
    ["datasets", "disturbances", "attitude", "plugins.catalogue"],
    ["filters", "adaptation"],
    ["engines", "evaluation"],
    ["plugins.checks", "report"],
    ["testing", "inspection"],
    ["jobs"],
    ["campaign", "report.changes", "report.study_figures"],
    ["hydra_app", "plugins.new"],
    ["api", "cli"],
    ["__main__"],
]
"""The modules of `plugins` other than the registry have their own stages, as have modules of `report` that need jobs.
Their names contain a dot.
"""
STAGE = {name: place for place, names in enumerate(ORDER) for name in names}
MAX_LEVELS = 14
"""Length of the longest chain of parts in which each imports the next. It may be lowered, and is never raised."""
PACKAGE = Path(jerkbench.__file__).parent


def part(*names):
    """The part of a module or a name of the package."""
    head = ".".join(names[:2])
    return head if head in STAGE else names[0]


def part_of(path):
    names = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(names[:2]).removesuffix(".__init__") if names[0] == "plugins" else part(*names)


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "jerkbench":
            yield from (part(*node.module.split(".")[1:], alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (part(*a.name.split(".")[1:]) for a in node.names if a.name.startswith("jerkbench."))


@cache
def graph():
    """The parts that each part imports."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        found.setdefault(part_of(path), set()).update(imports(path))
    return {name: (found[name] & set(STAGE)) - {name} for name in found if name != "__init__"}


def test_every_part_of_the_package_has_its_place():
    assert set(graph()) == set(STAGE)


def test_nothing_imports_from_the_same_or_a_later_stage():
    backwards = [
        f"{name} imports {other}"
        for name, others in graph().items()
        for other in others
        if STAGE[other] > STAGE[name] or STAGE[other] == STAGE[name] > 0
    ]

    assert backwards == []


def test_chains_of_imports_get_no_longer():
    @cache
    def level(name):
        return 1 + max(map(level, graph()[name]), default=0)

    assert max(map(level, graph())) <= MAX_LEVELS
