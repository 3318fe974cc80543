"""The key of a cell follows the code that computes, and no other."""

import ast
from pathlib import Path

import jerkbench
from jerkbench.jobs import key
from jerkbench.jobs.job import metric_names
from jerkbench.plugins import PACKAGES, _registry

PACKAGE = Path(jerkbench.__file__).parent
RUNNING = ("jobs/rows", "campaign/split")
NO_NUMBERS = {
    *("api", "errors", "fetching", "files", "notices", "parameters", "places", "presets"),
    *(f"plugins/{name}" for name in ("__init__", "checks", "members")),
    *(f"jobs/{name}" for name in ("key", "names", "preflight")),
}
"""Rooms and modules that refuse, name or say something; what they import is not followed."""


def in_rooms(module, rooms):
    return not {module, *(str(parent) for parent in Path(module).parents)}.isdisjoint(rooms)


def modules_of(names):
    for name in names:
        if name.partition(".")[0] != "jerkbench":  # installed, other packages lie beside ours
            continue
        place = PACKAGE.parent / name.replace(".", "/")
        if place.with_suffix(".py").is_file():
            yield place.with_suffix(".py")
        elif (place / "__init__.py").is_file() and place != PACKAGE and not only_a_docstring(place / "__init__.py"):
            yield place / "__init__.py"


def only_a_docstring(path):
    return all(isinstance(node, ast.Expr) for node in ast.parse(path.read_text()).body)


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_all_that_runs_a_cell_lies_in_the_computing_rooms():
    plugins = [path for name in PACKAGES.values() for path in (PACKAGE.parent / name.replace(".", "/")).rglob("*.py")]
    begun = [*plugins, *(PACKAGE / f"{name}.py" for name in RUNNING)]
    waiting, outside, visited = list(begun), {}, set()
    while waiting:
        path = waiting.pop()
        for found in modules_of(imported(path)):
            module = found.relative_to(PACKAGE).with_suffix("").as_posix()
            if found in visited or in_rooms(module, NO_NUMBERS):
                continue
            visited.add(found)
            waiting.append(found)
            if not in_rooms(module, key.COMPUTING):
                outside[module] = path.name
    assert outside == {}
    reached = [found.relative_to(PACKAGE).with_suffix("").as_posix() for found in (*begun, *visited)]
    assert [room for room in key.COMPUTING if not any(in_rooms(module, [room]) for module in reached)] == []


def test_every_computing_room_exists():
    missing = [room for room in key.COMPUTING if not list(PACKAGE.glob(f"{room}*"))]
    assert missing == []


def test_an_edit_counts_where_something_is_computed(tmp_path, monkeypatch):
    monkeypatch.setattr(key, "PACKAGE_FOLDER", tmp_path)
    names = ("filters/one.py", "hydra_app/messages.py", "campaign/search.py", "jobs/job.py", "jobs/key.py")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1")

    def counts(name):
        before = key.code_digest.__wrapped__()
        (tmp_path / name).write_text("2")
        return key.code_digest.__wrapped__() != before

    assert list(filter(counts, names)) == ["filters/one.py", "jobs/job.py"]


def test_a_metric_from_elsewhere_is_computed_where_it_is_asked_for(monkeypatch):
    before = metric_names([])
    foreign = type("Foreign", (), {"__module__": "elsewhere"})
    monkeypatch.setitem(_registry["metric"], "a_foreign_one", foreign)

    assert metric_names([]) == metric_names(["default"]) == before
    assert metric_names(["default", "a_foreign_one"]) == (*before, "a_foreign_one")
    assert "a_foreign_one" in metric_names(["all"])
