"""CONTRIBUTING and the files beside it, against the tree."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from test_import_direction import STAGE

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.mark.parametrize("name", sorted({*re.findall(r"`((?:jerkbench|tests|conf)/[\w/.]*|\w+/\w+\.py)`", TEXT)}))
def test_every_place_it_names_is_there(name):
    assert (ROOT / name).exists() or (ROOT / "jerkbench" / name).exists()


def test_the_drawing_has_every_room_in_the_order_in_which_they_import():
    drawing = re.search(r"```text\n(.*?)```", TEXT, flags=re.DOTALL).group(1)
    rooms = {
        name
        for line in drawing.splitlines()
        for name in re.findall(r"[a-z][\w/]*", re.split(r"\s{3,}", line.strip())[0])
    }
    for room in rooms:
        place = ROOT / "jerkbench" / room
        assert place.is_dir() or place.with_suffix(".py").is_file(), room
    folders = {path.parent.name for path in (ROOT / "jerkbench").glob("*/__init__.py")}
    assert folders - {"compilation"} <= rooms | {"evaluation"}
    lines = [re.split(r"\s{3,}", line.strip())[0] for line in drawing.splitlines()]
    places = [STAGE[room] for line in lines for room in re.findall(r"[a-z]\w*", line)]
    assert places == sorted(places)


@pytest.mark.parametrize("command", re.findall(r"^\.venv/bin/(\w+)", TEXT, flags=re.MULTILINE))
def test_every_command_comes_with_the_development_extra(command):
    test = PROJECT["optional-dependencies"]["test"]
    dev = PROJECT["optional-dependencies"]["dev"]

    assert command == "pip" or any(requirement.startswith(command) for requirement in test + dev)


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))

    assert citation["version"] == PROJECT["version"]
    assert f"## {citation['version']} - {citation['date-released']}" in (ROOT / "CHANGELOG.md").read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize("path", sorted((ROOT / ".github").rglob("*.yml")), ids=lambda path: path.name)
def test_workflows_and_templates_are_yaml(path):
    assert yaml.safe_load(path.read_text(encoding="utf-8"))


def test_the_workflow_tests_every_python_that_is_allowed():
    workflow = yaml.safe_load((ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8"))
    named = {c.rsplit(" ", 1)[1] for c in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", c)}

    assert set(workflow["jobs"]["test"]["strategy"]["matrix"]["python-version"]) == named
