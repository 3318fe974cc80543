"""BibTeX of a study: what its plugins' docstrings name, once each."""

from pathlib import Path
from typing import ClassVar

import pytest
import yaml

from commands import verb
from jerkbench import api
from jerkbench.adaptation.huber import HuberR
from jerkbench.adaptation.mtf import Mtf, MtfNis
from jerkbench.report.writers import entry, merged

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    api.sweep(
        folder, dataset={"name": "field", "duration_s": 12}, filter="bias", adaptation=["none", "huber_r"], seeds=1
    )
    return folder


def test_every_source_of_a_study_is_there_once_and_no_other(study, tmp_path):
    done = verb("cite", str(study), cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    for doi in ("10.1109/TAC.1969.1099223", "10.1115/1.3662552", "10.1214/aoms/1177703732"):
        assert done.stdout.count(doi) == 1
    assert "10.1016/j.isatra.2010.04.001" not in done.stdout
    assert "% No source is stated by: dataset field," in done.stdout


def test_without_a_study_it_is_the_citation_of_the_package_and_without_results_refused(tmp_path):
    done = verb("cite", "results/none", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("jerkbench: results/none has no results; ")
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    text = verb("cite", cwd=tmp_path).stdout
    assert text.startswith("@software{jerkbench,\n")
    assert f"{{{cited['title']}}}" in text
    assert f"{{{cited['version']}}}" in text


def test_sources_are_read_as_a_person_would_and_merged():
    (text,) = merged({HuberR: "adaptation huber_r"})
    assert text.splitlines()[0] == "@misc{10_1214_aoms_1177703732,"
    for field in ("author = {P. J. Huber}", "title  = {Robust estimation of a location parameter}", "year   = {1964}"):
        assert field in text
    text = entry(
        "10.1/x", 'Source: as in A. B. Cee, D. Eff and G.-H. Ijk, "Of things", Journal 3, 517-529, 1987, ', ["a"]
    )
    assert "author = {A. B. Cee and D. Eff and G.-H. Ijk}" in text
    assert "year   = {1987}" in text
    (text,) = merged({Mtf: "adaptation mtf", MtfNis: "adaptation mtf_nis"})
    assert "note   = {jerkbench: adaptation mtf, adaptation mtf_nis}" in text

    class Owning(HuberR):
        """Another one."""

        citations: ClassVar[tuple[str, ...]] = ("@article{mine}",)

    assert next(iter(merged({Owning: "adaptation owning"}))) == "@article{mine}"
