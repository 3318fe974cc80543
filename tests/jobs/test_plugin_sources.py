"""The key of a plugin from elsewhere follows its helpers, the data beside it, and what it imports."""

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

LONE = """
from importlib import import_module
from importlib.util import spec_from_file_location
from pathlib import Path

import lone_sibling
from other_distribution import nothing

TABLE = Path(__file__).parent / "tables" / "gains.csv"


OTHER = import_module("lone_by_name")
HERE = spec_from_file_location("by_path", Path(__file__).parent / "lone_by_path.py")


class Rule:
    depends_on = ("../far/gains.csv", "../far_folder", "$LONE_GAIN")

    def adapt(self, innovation, HPHt, R, rows, memory):
        import lone_lazy

        return lone_sibling.K * R
"""
FILES = {
    "lone_rule.py": LONE,
    "lone_sibling.py": "from lone_deeper import K\n",
    "lone_deeper.py": "K = 1.0\n",
    "lone_lazy.py": "K = 1.0\n",
    "lone_by_name.py": "K = 1.0\n",
    "lone_by_path.py": "K = 1.0\n",
    "lone_unrelated.py": "K = 1.0\n",
    "beside.npy": "1",
    "tables/gains.csv": "1\n",
    "results/rows.csv": "1\n",
    "other_distribution/__init__.py": "nothing = None\n",
    "other_distribution/table.csv": "1\n",
    "other_distribution-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: other-distribution\nVersion: 1.0\n",
    "other_distribution-1.0.dist-info/top_level.txt": "other_distribution\n",
    "other_distribution-1.0.dist-info/RECORD": "other_distribution/__init__.py,,\nother_distribution/table.csv,,\n",
}
NAMES = ("lone_by_name", "lone_rule", "lone_sibling", "lone_deeper", "lone_lazy", "other_distribution")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder on the way of imports with all of FILES."""
    tmp_path = tmp_path / "modules"
    tmp_path.mkdir()
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in NAMES:
        sys.modules.pop(name, None)


def digest():
    """The digest as a new process would make it."""
    for name in NAMES:
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    plugin_digest.cache_clear()
    key._owners.cache_clear()
    return plugin_digest(importlib.import_module("lone_rule").Rule)


def edited(path, text):
    path.write_text(text)
    return digest()


@pytest.mark.parametrize(
    "name",
    [
        "lone_sibling.py",
        "lone_deeper.py",
        "lone_lazy.py",
        "lone_by_name.py",
        "lone_by_path.py",
        "beside.npy",
        "tables/gains.csv",
    ],
)
def test_an_edit_of_what_it_uses_gives_another(folder, name):
    before = digest()
    assert digest() == before
    assert edited(folder / name, FILES[name].replace("1", "2") + "K = 5.0\n" * name.endswith(".py")) != before


@pytest.mark.parametrize("name", ["../far/gains.csv", "../far_folder/inside.csv"])
def test_a_place_that_it_names_counts_though_it_lies_elsewhere(folder, name):
    before = digest()
    (folder / name).parent.mkdir(exist_ok=True)
    first = edited(folder / name, "1")
    assert len({before, first, edited(folder / name, "2")}) == 3


def test_a_variable_that_it_names_counts(folder, monkeypatch):
    before = digest()
    monkeypatch.setenv("LONE_GAIN", "2")
    assert digest() != before


@pytest.mark.parametrize("name", ["lone_unrelated.py", "results/rows.csv", "other_distribution/table.csv"])
def test_an_edit_of_what_it_does_not_use_gives_the_same(folder, name):
    before = digest()
    assert edited(folder / name, "K = 3.0\n") == before


def test_another_version_of_a_distribution_that_it_imports_gives_another(folder):
    before = digest()
    metadata = "other_distribution-1.0.dist-info/METADATA"
    assert edited(folder / metadata, FILES[metadata].replace("Version: 1.0", "Version: 1.1")) != before


def test_one_that_can_be_edited_counts_by_its_content(folder, monkeypatch, tmp_path_factory):
    """As pip installs it with --editable: what it is made of lies elsewhere."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (folder / "other_distribution").rename(elsewhere / "other_distribution")
    monkeypatch.syspath_prepend(elsewhere)
    before = digest()

    assert edited(elsewhere / "other_distribution" / "table.csv", "2\n") != before


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
