"""`list` and `show`, as text and as JSON: parameters, ranges, origins and provenance of plugins."""

import inspect
import json
import math
from dataclasses import dataclass, fields
from typing import Annotated

import pytest

from commands import verb
from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.jobs.study import load_study
from jerkbench.parameters import Provenance, Range, origins_of, provenance_of, range_problems
from jerkbench.plugins.catalogue import list_text, listed_json, show_text, shown_json
from jerkbench.plugins.checks import check_plugin
from stored_cells import put


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


def test_a_parameter_has_its_default_origin_and_range_and_a_preset_its_values(tmp_path):
    content = json.loads(verb("show", "adaptation", "mtf", "--format", "json", cwd=tmp_path).stdout)
    (window,) = (parameter for parameter in content["parameters"] if parameter["name"] == "window")
    assert (window["type"], window["default"]) == ("int", 1)
    assert window["origin"].startswith("literature")
    assert (window["range"]["low"], window["range"]["high"], window["range"]["log"]) == (1, 50, True)
    assert content["defined_in"] == "jerkbench.adaptation.mtf.Mtf"
    content = json.loads(verb("show", "dataset", "ppc", "--format", "json", cwd=tmp_path).stdout)
    assert content["values"]["imu_axes"] == ["x", "-y", "-z"]
    done = verb("show", "filter", "jrek", "--format", "json", cwd=tmp_path)
    assert done.returncode == 2
    assert "jerk" in done.stderr


METHODS = [
    (kind, name)
    for kind in ("filter", "adaptation")
    for name in plugins.names(kind)
    if plugins.is_builtin(plugins.get(kind, name))
]


@pytest.mark.parametrize(("kind", "name"), METHODS)
def test_every_method_says_what_it_is_and_cites_it(kind, name):
    cls = plugins.get(kind, name)
    known = provenance_of(cls)

    assert known is not None
    assert not known.mistake()
    if known.source.startswith("doi:"):
        assert known.source in " ".join(inspect.getdoc(cls).split())


def test_one_sided_forms_and_our_variants_do_not_pass_as_published():
    kinds = {name: provenance_of(plugins.get("adaptation", name)).kind for _, name in METHODS if _ == "adaptation"}

    assert {kind for name, kind in kinds.items() if name.endswith("_r")} == {"simplified"}
    assert kinds["sage_husa_qr"] == kinds["mtf_block"] == kinds["relaxing_gate"] == "own"
    assert kinds["ssmkf"] == kinds["student_t"] == kinds["huber"] == "published"


@pytest.mark.parametrize(
    ("provenance", "word"),
    [
        (Provenance("borrowed", "doi:10.1/1"), "published, simplified or own"),
        (Provenance("published", ""), "a published method needs a source and no note"),
        (Provenance("simplified", "", "Without R."), "a published method needs a source and no note"),
        (Provenance("simplified", "doi:10.1/1"), "other methods need a note"),
        (Provenance("published", "doi:10.1/1", "Without R."), "needs a source and no note"),
    ],
)
def test_half_a_statement_is_refused(provenance, word, monkeypatch):
    assert word in provenance.mistake()
    monkeypatch.setattr(NoAdaptation, "provenance", provenance)
    with pytest.raises(AssertionError, match=word):
        check_plugin("adaptation", NoAdaptation())


@dataclass(frozen=True)
class Silent(NoAdaptation):
    """R as reported."""


def test_ours_have_to_say_it_and_others_may(monkeypatch):
    check_plugin("adaptation", Silent())
    monkeypatch.delattr(NoAdaptation, "provenance")
    with pytest.raises(AssertionError, match="has no provenance"):
        check_plugin("adaptation", NoAdaptation())


def test_the_catalogue_tells_and_counts_provenance_origins_and_ranges():
    kinds = [provenance_of(plugins.get(*method)).kind for method in METHODS if method[0] == "adaptation"]
    heading, *lines = list_text("adaptation").splitlines()
    assert f"{kinds.count('published')} published" in heading
    assert next(line for line in lines if line.split()[0] == "huber_r").endswith("[simplified]")
    assert "Method: published (doi:10.2514/1.G000799)\n" in show_text("adaptation", "huber")
    assert "Method: own (Sage and Husa, 1969): The recursion" in show_text("adaptation", "sage_husa_qr")
    listed = {each["name"]: each for each in listed_json("adaptation")["adaptation"]}
    assert listed["huber"]["provenance"] == "published"
    assert shown_json("filter", "jerk")["provenance"]["kind"] == "published"
    assert "provenance" not in shown_json("dataset", "field")
    text = show_text("adaptation", "mtf")
    assert "window: literature: the paper has mu = 1" in text
    assert "range 1 to 50, logarithmic (ours: " in text


def test_a_note_of_a_study_names_what_is_not_as_published(tmp_path):
    for key, adaptation in enumerate(("none", "huber", "oracle")):
        put(tmp_path, f"{key}", 0.1, filter="baseline", adaptation=adaptation)
    assert "as published" not in " ".join(load_study(tmp_path).notes)
    for key, (model, adaptation) in enumerate(
        [("gnss_only", "none"), ("baseline", "huber_r"), ("bias", "mtf_block")], 3
    ):
        put(tmp_path, f"{key}", 0.1, filter=model, adaptation=adaptation)
    (note,) = [note for note in load_study(tmp_path).notes if note.startswith("Not as published")]
    assert note.startswith("Not as published: simplified: huber_r, bias; own: mtf_block.")


@pytest.mark.parametrize(
    ("bounds", "middle"),
    [(Range(1.0, 3.0), 2.0), (Range(0.01, 1.0, log=True), 0.1), (Range(0.9, 0.999, toward_one=True), 0.99)],
)
def test_the_middle_of_a_range_is_that_of_its_scale(bounds, middle):
    assert bounds.value(0.5) == pytest.approx(middle)
    assert bounds.share(middle) == pytest.approx(0.5)
    assert (bounds.value(0.0), bounds.value(1.0)) == (bounds.low, pytest.approx(bounds.high))


@pytest.mark.parametrize(
    "bounds",
    [
        Range(2.0, 2.0, source="x"),
        Range(1.0, math.inf, source="x"),
        Range(0.0, 1.0, log=True, source="x"),
        Range(0.5, 1.0, toward_one=True, source="x"),
        Range(0.5, 0.9, log=True, toward_one=True, source="x"),
        Range(0.5, 0.9),
    ],
)
def test_a_range_without_sense_is_not_valid(bounds):
    assert not bounds.valid


def made(annotation, default):
    @dataclass(frozen=True)
    class Plugin:
        knob: annotation = default

    return Plugin


@pytest.mark.parametrize(
    ("annotation", "default", "sentence"),
    [
        (Annotated[float, Range(1.0, 2.0, source="x")], 3.0, "outside of its range 1 to 2"),
        (Annotated[float, Range(2.0, 1.0, source="x")], 1.5, "is not valid"),
        (Annotated[float | None, Range(1.0, 2.0, source="x")], None, "needs a number to start from"),
        (Annotated[int, Range(0.5, 2.0, source="x")], 1, "is an integer"),
    ],
)
def test_the_conformance_kit_refuses_a_range_that_does_not_fit(annotation, default, sentence):
    (problem,) = range_problems(made(annotation, default))

    assert sentence in problem


def test_every_number_of_our_filters_and_adaptations_says_where_its_default_comes_from():
    switches = {"track_least_m", "still_window_s", "still_accel_mps2", "still_gyro_radps", "still_below_mps"}
    switches |= {"constraint_interval_s"}
    switches |= {"max_gap_s", "time_limit_s", "seed"}  # of trajectories and programs from elsewhere
    for kind in ("filter", "adaptation"):
        for name in plugins.names(kind):
            cls = plugins.get(kind, name)
            if plugins.is_builtin(cls):
                numbers = {field.name for field in fields(cls) if type(field.default) in (int, float)}
                assert numbers - switches <= set(origins_of(cls)), name
