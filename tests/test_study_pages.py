"""The pages of the studies against the rows that are kept beside them: quotations, and tables."""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from commands import environment
from jerkbench.jobs.study import load_study
from jerkbench.report.findings import sentence, varying_factors
from jerkbench.report.study_verdicts import study_verdicts

ROOT = Path(__file__).parents[1]
KEPT = {"paper": "paper20"}
"""Pages that quote, and the folders of their rows."""

METRIC = "position_rmse_m"


def page(study):
    return (ROOT / "experiments" / study / "README.md").read_text(encoding="utf-8")


@cache
def rows(study):
    return load_study(ROOT / "results" / KEPT.get(study, study)).rows


@cache
def sentences(study):
    """Every comparison of the study's family, as either side sees it, and "equal" in either order."""
    varying = varying_factors(rows(study))
    judged = study_verdicts(rows(study), METRIC).judged.values()
    return "\n".join(sentence(seen, varying) for own in judged for seen in (own, own.turned))


@pytest.mark.parametrize("study", KEPT)
def test_what_is_quoted_is_said_by_the_rows(study):
    text = page(study).replace("\n", " ")
    quoted = [words for words in re.findall(r'"([^"]+)"', text) if re.search(r"\d times|equal within", words)]
    assert len(quoted) > 5
    for words in quoted:
        assert re.sub(r"\s+", " ", words) in sentences(study), words


SCRIPTS = {"replayed": "summary.py", "drive": "best.py", "filters": "verdicts.py"}
"""Pages whose tables, and lists of sentences, a script of the study prints from the rows."""


@pytest.mark.parametrize("study", SCRIPTS)
def test_what_a_script_prints_stands_on_the_page(study):
    script = ROOT / "experiments" / study / SCRIPTS[study]
    command = [sys.executable, str(script), str(ROOT / "results" / study)]
    printed = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True).stdout
    made = [line for line in printed.splitlines() if line.startswith(("| ", "- "))]
    assert len(made) > 4
    assert [line for line in made if line not in page(study).splitlines()] == []


@pytest.mark.parametrize("study", SCRIPTS)
def test_every_interval_on_the_page_is_one_of_the_table(study):
    table = (ROOT / "results" / study / "table.md").read_text(encoding="utf-8").replace("**", "")
    for words in re.findall(r"\d[\d.]* \[[\d., ]+\]", page(study)):
        assert words in table, words
