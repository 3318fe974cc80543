"""The catalogue for programs: a person reads the same, and runs take it."""

import json

import pytest

from commands import verb
from jerkbench import plugins
from jerkbench.plugins.catalogue import list_text, listed_json, shown_json


def test_every_name_that_a_person_reads_is_in_the_json(tmp_path):
    content = json.loads(verb("list", "--format", "json", cwd=tmp_path).stdout)
    lines = {line.split()[0] for line in list_text().splitlines() if line.startswith("  ")}

    assert lines == {entry["name"] for entries in content.values() for entry in entries}
    assert {"name": "mtf", "preset": False, "package": "jerkbench"}.items() <= _entry(
        content, "adaptation", "mtf"
    ).items()
    assert _entry(content, "dataset", "kitti")["preset"]


def _entry(content, kind, name):
    (entry,) = (entry for entry in content[kind] if entry["name"] == name)
    return entry


@pytest.mark.parametrize("kind", [*plugins.KINDS, "noise", "experiment"])
def test_everything_that_is_listed_is_shown_as_strict_json(kind):
    for entry in listed_json(kind)[kind]:
        content = shown_json(kind, entry["name"])
        assert json.loads(json.dumps(content, allow_nan=False))["preset"] == entry["preset"]


def test_a_parameter_has_its_default_origin_and_range(tmp_path):
    content = json.loads(verb("show", "adaptation", "mtf", "--format", "json", cwd=tmp_path).stdout)
    (window,) = (parameter for parameter in content["parameters"] if parameter["name"] == "window")

    assert (window["type"], window["default"]) == ("int", 1)
    assert window["origin"].startswith("literature")
    assert (window["range"]["low"], window["range"]["high"], window["range"]["log"]) == (1, 50, True)
    assert content["defined_in"] == "jerkbench.adaptation.mtf.Mtf"


def test_the_defaults_make_the_plugin():
    parameters = shown_json("filter", "jerk")["parameters"]
    made = plugins.create("filter", {"name": "jerk", **{p["name"]: p["default"] for p in parameters}})

    assert made == plugins.get("filter", "jerk")()


def test_a_preset_has_its_values(tmp_path):
    content = json.loads(verb("show", "dataset", "ppc", "--format", "json", cwd=tmp_path).stdout)

    assert content["values"]["imu_axes"] == ["x", "-y", "-z"]


def test_a_name_that_is_not_there_is_a_sentence(tmp_path):
    done = verb("show", "filter", "jrek", "--format", "json", cwd=tmp_path)

    assert done.returncode == 2
    assert "jerk" in done.stderr
