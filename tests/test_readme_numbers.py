"""Every number of a result in the README is that of committed rows, or stands in a committed table."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import experiment
from jerkbench.campaign.answer import answer_summary, answered
from jerkbench.campaign.audit import read_rows
from jerkbench.jobs.study import load_study
from jerkbench.report.table_model import number

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAPER = (ROOT / "experiments/paper/README.md").read_text(encoding="utf-8")
ADAPTATIONS = ("none", "sage_husa", "mtf", "oracle")
AUDIT = ROOT / "results" / "audit-full"
needs_audit = pytest.mark.skipif(
    not (AUDIT / "answer.json").exists(), reason="no audit by today's protocol is committed"
)


def table_after(words, page):
    """The cells of the first table after ``words``, without its head."""
    lines = page[page.index(words) :].split("\n|", 1)[1].split("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.fixture(scope="module")
def paper():
    rows = load_study(ROOT / "results" / "paper20").rows
    return rows.set_index(["dataset", "disturbance", "filter", "adaptation"]).sort_index()


@needs_audit
def test_the_finding_has_the_numbers_of_the_rows():
    front = experiment("audit/front.py")
    (block,) = re.findall(r"<!-- audit -->\n(.*?)<!-- /audit -->", README, flags=re.DOTALL)

    assert block == front.front(front.Audit(AUDIT)), "run python experiments/audit/front.py README.md"
    assert len(block.partition("\n\n")[0].split()) <= 100


def test_the_finding_is_not_written_if_the_results_contradict_it(tmp_path, monkeypatch):
    front = experiment("audit/front.py")
    found = (ROOT / "results" / "journeys" / "answer.md").read_text(encoding="utf-8")
    (tmp_path / "journeys").mkdir()
    (tmp_path / "journeys" / "answer.md").write_text(found.replace("**worse**", "**better**"), encoding="utf-8")
    monkeypatch.setattr(front, "RESULTS", tmp_path)

    with pytest.raises(SystemExit, match="rewrite the text"):
        front.front(front.Audit(AUDIT))


@needs_audit
def test_an_independent_script_finds_the_same_numbers(capsys):
    """The script has its own statistics, with pandas and SciPy only; it also agrees with the verdicts in kinds.csv."""
    recompute = experiment("audit/recompute.py")
    kinds = pd.read_csv(AUDIT / "kinds.csv")
    counts = {
        kind: tuple((of["verdict"] == v).sum() for v in ("better", "worse")) for kind, of in kinds.groupby("kind")
    }

    assert recompute.main() == 0, capsys.readouterr().out
    text = Path(recompute.__file__).read_text(encoding="utf-8")
    assert "jerkbench" not in re.findall(r"^(?:import|from) (\w+)", text, re.MULTILINE)
    assert recompute.Audit(AUDIT).better_and_worse() == counts


@pytest.mark.parametrize("line", table_after("correlated in time:", PAPER), ids=lambda line: " ".join(line[:3]))
def test_the_table_of_the_paper_has_the_medians_of_its_rows(line, paper):
    *scenario, model = line[:3]
    for adaptation, text in zip(ADAPTATIONS, line[3:], strict=True):
        if text == "-":
            assert (*scenario, model, adaptation) not in paper.index
            continue
        runs = paper.loc[(*scenario, model, adaptation)]
        failed = int((runs["status"] != "ok").sum())
        diverged = re.search(r"diverged (\d+)/20", text)
        assert failed == (int(diverged[1]) if diverged else 0)
        if not diverged:
            assert text.split()[0] == number(runs["position_rmse_m"].median())


def test_a_number_of_an_entry_is_that_of_its_manifest():
    marks = re.findall(r"([\d.]+\d)<!-- (\S+) (\w+) -->", PAPER)
    assert marks
    for text, entry, key in marks:
        score = json.loads((ROOT / "results" / "suite-v2" / entry / "manifest.json").read_text())["score"]
        assert text == f"{score[key]:.2f}"


def test_the_papers_claims_are_those_of_its_rows_by_hand_for_one(paper):
    """By hand, of one scenario: roll under a bias, which is far beyond what is claimed."""
    claims = experiment("paper/claims.py")
    assert claims.table(ROOT / "results" / "paper20") in PAPER
    roll = claims.claims(load_study(ROOT / "results" / "paper20").rows)[0]
    place = [(scenario.noise, scenario.fault) for scenario in roll.scenarios].index(("field_white", "imu_bias"))
    own = paper.loc[("field_white", "imu_bias", "jerk", "mtf"), "roll_rmse_rad"]
    assert roll.numbers[place, 0] == pytest.approx(np.exp(np.log(own).mean()))
    assert roll.words[place] == "does not hold"


@pytest.mark.slow
@needs_audit
def test_the_audits_page_is_that_of_its_rows():
    told = json.loads((AUDIT / "answer.json").read_text(encoding="utf-8"))
    answer = answered(read_rows(AUDIT))

    assert json.loads(json.dumps(answer_summary(answer, told["commit"]))) == told
    committed = (ROOT / "experiments/audit/README.md").read_text(encoding="utf-8")
    audit_page = experiment("audit/audit_page.py").audit_page
    assert audit_page(answer, AUDIT, told["commit"]) == committed
