"""Every number of a result in the README is that of committed rows, or stands in a committed table."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from experiment_scripts import experiment
from jerkbench.campaign.answer import answer_summary, answered
from jerkbench.campaign.audit import read_rows
from jerkbench.jobs.study import load_study
from jerkbench.report.table_model import number

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COLUMNS = ("gnss_only", "baseline_untuned", "baseline", "jerk", "bias")
DISTURBANCES = {
    "nothing wrong": "none",
    "multipath on one axis": "multipath_single_axis",
    "accelerometer and gyro bias": "imu_bias",
    "bias and two outages": "imu_bias+gnss_outage",
}


AUDIT = ROOT / "results" / "audit-full"
needs_audit = pytest.mark.skipif(
    not (AUDIT / "answer.json").exists(), reason="no audit by today's protocol is committed"
)


def table_after(words, page=README):
    """The cells of the first table after ``words``, without its head."""
    lines = page[page.index(words) :].split("\n|", 1)[1].split("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.fixture(scope="module")
def paper():
    rows = load_study(ROOT / "results" / "paper20").rows
    return rows[rows["dataset"] == "field_white"].set_index(["disturbance", "filter", "adaptation"]).sort_index()


@needs_audit
def test_the_first_screen_is_that_of_the_committed_results():
    front = experiment("audit/front.py")
    (block,) = re.findall(r"<!-- audit -->\n(.*?)<!-- /audit -->", README, flags=re.DOTALL)
    assert block == front.front(), "python experiments/audit/front.py README.md writes it anew"


def test_the_first_screen_is_not_written_where_its_sentences_would_be_wrong(tmp_path, monkeypatch):
    front = experiment("audit/front.py")
    for name in ("journeys", "vehicles"):
        found = (ROOT / "results" / name / "answer.md").read_text(encoding="utf-8")
        (tmp_path / name).mkdir()
        (tmp_path / name / "answer.md").write_text(found.replace("**undecided**", "**better**"), encoding="utf-8")
    monkeypatch.setattr(front, "RESULTS", tmp_path)

    with pytest.raises(SystemExit, match=r"'UWB': 'better'.* write it anew"):
        front._journeys()


@pytest.mark.parametrize("line", table_after("position RMSE in metres:"), ids=lambda line: " ".join(line[:2]))
def test_the_papers_table_is_that_of_its_rows(line, paper):
    name, adaptation, *cells = line
    for column, text in zip(COLUMNS, cells, strict=True):
        if text == "-":
            assert (DISTURBANCES[name], column, adaptation) not in paper.index
            continue
        runs = paper.loc[(DISTURBANCES[name], column, adaptation)]
        lost = int((runs["status"] != "ok").sum())
        if "diverged" in text:
            assert lost == (len(runs) if text == "all diverged" else int(text.split()[0]))
        elif "locked out" in text:
            assert text.startswith(f"{runs['position_rmse_m'].median():.3g}".ljust(6, "0"))
        else:
            assert lost == 0
            assert text == number(runs["position_rmse_m"].median())


def test_a_number_of_an_entry_is_that_of_its_manifest():
    text = (ROOT / "experiments/paper/README.md").read_text(encoding="utf-8")
    marks = re.findall(r"<!-- (\S+) (\w+) -->([\d.]+\d)", text)
    assert marks
    for entry, key, text in marks:
        score = json.loads((ROOT / "results" / "suite-v2" / entry / "manifest.json").read_text())["score"]
        assert text == f"{score[key]:.2f}"


def test_the_papers_claims_are_those_of_its_rows():
    claims = experiment("paper/claims.py")
    assert claims.table(ROOT / "results" / "paper20") in (ROOT / "experiments/paper/README.md").read_text(
        encoding="utf-8"
    )


def test_a_claim_on_the_tilt_is_that_of_the_geometric_mean(paper):
    """By hand, of one scenario: roll under a bias, which is far beyond what is claimed."""
    claims = experiment("paper/claims.py")
    roll = claims.claims(load_study(ROOT / "results" / "paper20").rows)[0]
    place = [(scenario.noise, scenario.fault) for scenario in roll.scenarios].index(("field_white", "imu_bias"))
    own = paper.loc[("imu_bias", "jerk", "mtf"), "roll_rmse_rad"]
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
