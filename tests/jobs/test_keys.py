"""The keys of combinations: code of jerkbench, code of plugins, processors."""

import ast
import importlib
import sys
import types
from pathlib import Path

import pytest

import jerkbench
from jerkbench.adaptation.mtf import Mtf
from jerkbench.datasets.field import Field
from jerkbench.errors import PluginError
from jerkbench.jobs import key
from jerkbench.jobs.job import metric_names
from jerkbench.jobs.key import plugin_digest, processor_kind
from jerkbench.jobs.rows import _key
from jerkbench.plugins import PACKAGES, _registry

PACKAGE = Path(jerkbench.__file__).parent
RUNNING = ("jobs/rows", "campaign/split")
NO_NUMBERS = {
    *("api", "errors", "files", "places", "presets"),
    *(f"plugins/{name}" for name in ("__init__", "checks", "members")),
    *(f"jobs/{name}" for name in ("key", "names")),
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


def test_a_metric_and_a_simulation_from_elsewhere_depend_on_their_code(monkeypatch):
    before = metric_names([])
    foreign = type("Foreign", (), {"__module__": "elsewhere"})
    monkeypatch.setitem(_registry["metric"], "a_foreign_one", foreign)
    assert metric_names([]) == metric_names(["default"]) == before
    assert metric_names(["default", "a_foreign_one"]) == (*before, "a_foreign_one")
    assert "a_foreign_one" in metric_names(["all"])
    before = _key(Field(), 1)
    monkeypatch.setattr("jerkbench.jobs.rows.plugin_digest", lambda _: "an edit")
    assert _key(Field(), 1) != before


RULE = """
class Rule:
    depends_on = ("lone_helper.py", "../far/gains.csv", "../far_folder", "$LONE_GAIN")
"""
FILES = {
    "lone_rule.py": RULE,
    "lone_helper.py": "K = 1.0\n",
    "lone_unrelated.py": "K = 1.0\n",
    "results/rows.csv": "1\n",
    "own_package/__init__.py": "",
    "own_package/rules.py": "from own_package.helper import K\nclass Rule: pass\n",
    "own_package/helper.py": "K = 1.0\n",
    "own_package/table.csv": "1\n",
    "own_package-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: own-package\nVersion: 1.0\n",
    "own_package-1.0.dist-info/top_level.txt": "own_package\n",
    "own_package-1.0.dist-info/RECORD": "own_package/__init__.py,,\n",
}
NAMES = ("lone_rule", "own_package", "own_package.rules", "own_package.helper")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder on the import path with all of FILES."""
    tmp_path = tmp_path / "modules"
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / name).write_text(text)
    elsewhere = [place for place in sys.path if "site-packages" not in place]
    monkeypatch.setattr(sys, "path", [str(tmp_path), *elsewhere])  # few distributions are read quickly
    yield tmp_path
    for name in NAMES:
        sys.modules.pop(name, None)


def digest(module):
    """The digest as a new process would compute it."""
    for name in NAMES:
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    plugin_digest.cache_clear()
    key._distributions.cache_clear()
    return plugin_digest(importlib.import_module(module).Rule)


OWN = [f"own_package{name}" for name in ("/rules.py", "/helper.py", "/table.csv", "-1.0.dist-info/METADATA")]
CASES = [
    ("lone_rule", True, ["lone_rule.py", "lone_helper.py", "../far/gains.csv", "../far_folder/inside.csv"]),
    ("lone_rule", False, ["lone_unrelated.py", "results/rows.csv", "own_package/helper.py"]),
    ("own_package.rules", True, OWN),
    ("own_package.rules", False, ["lone_helper.py"]),
]


@pytest.mark.parametrize(("module", "used", "name"), [(*case, name) for *case, names in CASES for name in names])
def test_an_edit_changes_the_digest_of_what_uses_it(folder, module, used, name):
    before = digest(module)
    assert digest(module) == before
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(FILES.get(name, "").replace("1.0", "2.0") + "\n")

    assert (digest(module) != before) == used


def test_a_variable_that_it_names_counts(folder, monkeypatch):
    before = digest("lone_rule")
    monkeypatch.setenv("LONE_GAIN", "2")
    assert digest("lone_rule") != before


def test_a_class_without_a_file_is_another_in_each_process_and_ours_are_covered_by_our_code(monkeypatch):
    monkeypatch.setitem(sys.modules, "typed_in", types.ModuleType("typed_in"))
    rule = type("Rule", (), {"__module__": "typed_in"})
    plugin_digest.cache_clear()
    before = plugin_digest(rule)
    plugin_digest.cache_clear()
    assert plugin_digest(rule) == before
    monkeypatch.setattr("jerkbench.jobs.key._THIS_PROCESS", "another")
    plugin_digest.cache_clear()
    assert plugin_digest(rule) == "another"
    assert plugin_digest(Mtf) == ""
    with pytest.raises(PluginError, match="give a tuple of strings"):
        plugin_digest(type("Forgot", (), {"depends_on": "gains.csv"}))


CPUINFO = Path("/proc/cpuinfo")
FLAGS = {"sse2": "sse2", "sse4.2": "sse4_2", "avx": "avx", "avx2": "avx2", "fma": "fma", "avx512f": "avx512f"}
"""LLVM's names of instructions, and Linux's."""


@pytest.mark.skipif(not CPUINFO.exists() or "sse2" not in CPUINFO.read_text(), reason="needs Linux on x86-64")
def test_the_instructions_for_arithmetic_are_those_that_the_system_names():
    family, _, names = processor_kind().partition(": ")
    flags = next(line for line in CPUINFO.read_text().splitlines() if line.startswith("flags")).split()

    assert family
    assert {name for name in FLAGS if name in names.split()} == {name for name, flag in FLAGS.items() if flag in flags}
