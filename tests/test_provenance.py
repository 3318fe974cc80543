import inspect
from dataclasses import dataclass

import pytest

from commands import swept, verb
from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.parameters import Provenance, provenance_of
from jerkbench.plugins.catalogue import list_text, listed_json, show_text, shown_json
from jerkbench.plugins.checks import check_plugin

METHODS = [
    (kind, name)
    for kind in ("filter", "adaptation")
    for name in plugins.names(kind)
    if plugins.is_own(plugins.get(kind, name))
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
        (Provenance("published", ""), "has a source"),
        (Provenance("simplified", "", "Without R."), "has a source"),
        (Provenance("simplified", "doi:10.1/1"), "needs one"),
        (Provenance("published", "doi:10.1/1", "Without R."), "needs no note"),
        (Provenance("own", "", "Without an end"), "full stop"),
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


def test_the_catalogue_tells_and_counts_it():
    kinds = [provenance_of(plugins.get(*method)).kind for method in METHODS if method[0] == "adaptation"]
    heading, *lines = list_text("adaptation").splitlines()

    assert f"{kinds.count('published')} published" in heading
    assert next(line for line in lines if line.split()[0] == "huber_r").endswith("[simplified]")
    assert "Method: published (doi:10.2514/1.G000799)\n" in show_text("adaptation", "huber")
    assert "Method: own (Sage and Husa, 1969): Their" in show_text("adaptation", "sage_husa_qr")
    listed = {each["name"]: each for each in listed_json("adaptation")["adaptation"]}
    assert listed["huber"]["provenance"] == "published"
    assert shown_json("filter", "jerk")["provenance"]["kind"] == "published"
    assert "provenance" not in shown_json("dataset", "field")


def test_the_note_of_a_table_names_what_is_not_as_published(tmp_path):
    swept("adaptation=none,huber,huber_r,mtf_block,oracle", "filter=baseline,gnss_only,bias", "study=s", cwd=tmp_path)

    told = "Not as published: simplified: huber_r, bias; own: mtf_block."
    assert told in " ".join(verb("table", "results/s", cwd=tmp_path).stdout.split())


def test_the_published_ones_have_no_note(tmp_path):
    swept("adaptation=none,huber", "filter=baseline", "study=s", cwd=tmp_path)

    assert "as published" not in verb("table", "results/s", cwd=tmp_path).stdout
