"""The paper's claims, judged on rows and losses whose answers are known: made by hand, no filter runs."""

import numpy as np
import pandas as pd
import pytest

from commands import experiment
from jerkbench.campaign.answer import NO_FAULT
from made_rows import cell_rows, made_rows, study_rows

of_paper = experiment("paper/claims.py")
ten_times = experiment("paper/ten_times.py")
CLAIMED = of_paper.CLAIMED
claim_table, where_it_holds = of_paper.claim_table, of_paper.where_it_holds

SEEDS = 20


def found(log_ratio):
    """The claims of an audit in which jerk + mtf has this log ratio to baseline + none."""
    rows = made_rows(ratio={tuple(CLAIMED): log_ratio})
    return {claim.name.split(" ")[0]: claim for claim in of_paper.audit_claims(rows)}


@pytest.mark.parametrize(("times", "word"), [(40.0, "holds"), (3.0, "does not hold")])
def test_ten_times_is_judged_under_each_kind_of_fault(times, word):
    claim = found(-np.log(times))["more"]
    counts = {one: claim.words.count(one) for one in ("holds", "does not hold", "open")}
    assert counts[word] > 6 > counts["open"]  # a few kinds have few drives, and a lost one among them
    assert counts[word] + counts["open"] == 14
    assert (where_it_holds(claim) == "nowhere") == (word != "holds")


def test_centimetres_are_of_the_error_in_metres_and_resilience_asked_under_a_fault_only():
    claim = found(-3.0)["an"]
    assert claim.unit == "m"
    assert "does not hold" not in claim.words  # exp(-3 - 3) m
    assert claim.words.count("holds") > 6
    claim, other = found(-1.5)["resilient:"], found(-1.5)["more"]
    assert {s.fault for s in other.scenarios} - {s.fault for s in claim.scenarios} == {NO_FAULT}
    assert "| resilient: under a fault better | baseline |" in claim_table([claim])


@pytest.mark.parametrize(("factor", "word"), [(25.0, "It holds"), (2.0, "It does not hold"), (10.0, "It stays open")])
def test_the_papers_claim_is_judged(factor, word):
    rng = np.random.default_rng(2)
    base = np.exp(rng.normal(size=SEEDS))
    better = base / factor * np.exp(rng.normal(scale=0.3, size=SEEDS))
    rows = [*cell_rows("baseline", "none", list(base)), *cell_rows("jerk", "mtf", list(better))]
    (said,) = ten_times.claims(pd.DataFrame(rows))
    assert said.startswith(f"The paper says that jerk+mtf is more than 10 times better than baseline+none. {word}: ")
    assert ten_times.claims(pd.DataFrame(rows[:SEEDS])) == []


def test_few_seeds_neither_hold_a_claim_nor_refute_it_and_a_study_says_in_how_many_cases():
    rng = np.random.default_rng(2)
    base = np.exp(rng.normal(size=3))
    rows = [*cell_rows("baseline", "none", list(base)), *cell_rows("jerk", "mtf", list(base / 30))]
    (said,) = ten_times.claims(pd.DataFrame(rows))
    assert "Seen: 30.0 times, over 3 runs, without an interval; 0 of 3 failed (up to 63 %)." in said
    assert "it holds in 2" in ten_times.said(study_rows(20, 30.0))[0]
    assert ten_times.said(study_rows(2, 12.0)) == [ten_times.NOTHING_SHOWN]
