"""The key of a plugin from another package follows its files, its version, and the places in `depends_on`."""

import importlib
import sys
import types

import pytest

from jerkbench.adaptation.mtf import Mtf
from jerkbench.datasets.field import Field
from jerkbench.errors import PluginError
from jerkbench.jobs import key
from jerkbench.jobs.inputs import _key
from jerkbench.jobs.key import plugin_digest

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
    monkeypatch.syspath_prepend(tmp_path)
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


USED = [
    ("lone_rule", "lone_rule.py"),
    ("lone_rule", "lone_helper.py"),
    ("lone_rule", "../far/gains.csv"),
    ("lone_rule", "../far_folder/inside.csv"),
    ("own_package.rules", "own_package/rules.py"),
    ("own_package.rules", "own_package/helper.py"),
    ("own_package.rules", "own_package/table.csv"),
    ("own_package.rules", "own_package-1.0.dist-info/METADATA"),
]
UNUSED = [
    ("lone_rule", "lone_unrelated.py"),
    ("lone_rule", "results/rows.csv"),
    ("lone_rule", "own_package/helper.py"),
    ("own_package.rules", "lone_helper.py"),
]


@pytest.mark.parametrize(
    ("module", "name", "used"), [(*pair, True) for pair in USED] + [(*pair, False) for pair in UNUSED]
)
def test_an_edit_changes_the_digest_of_what_uses_it(folder, module, name, used):
    before = digest(module)
    assert digest(module) == before
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(FILES.get(name, "").replace("1.0", "2.0") + "\n")

    assert (digest(module) != before) == used


def test_a_variable_that_it_names_counts(folder, monkeypatch):
    before = digest("lone_rule")
    monkeypatch.setenv("LONE_GAIN", "2")
    assert digest("lone_rule") != before


def test_a_class_without_a_file_is_another_in_each_process(monkeypatch):
    monkeypatch.setitem(sys.modules, "typed_in", types.ModuleType("typed_in"))
    rule = type("Rule", (), {"__module__": "typed_in"})
    plugin_digest.cache_clear()
    before = plugin_digest(rule)
    plugin_digest.cache_clear()
    assert plugin_digest(rule) == before
    monkeypatch.setattr("jerkbench.jobs.key._this_process", lambda: "another")
    plugin_digest.cache_clear()

    assert plugin_digest(rule) == "another"


def test_our_own_are_covered_by_our_code():
    assert plugin_digest(Mtf) == ""


def test_a_simulation_from_elsewhere_is_kept_under_its_code(monkeypatch):
    before = _key(Field(), 1)
    monkeypatch.setattr("jerkbench.jobs.inputs.plugin_digest", lambda _: "an edit")

    assert _key(Field(), 1) != before


def test_a_place_that_is_not_in_a_tuple_is_refused():
    with pytest.raises(PluginError, match="give a tuple of texts"):
        plugin_digest(type("Forgot", (), {"depends_on": "gains.csv"}))
