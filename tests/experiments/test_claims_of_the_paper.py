"""The paper's claims, judged on rows and losses whose answers are known: made by hand, no filter runs."""

import numpy as np
import pandas as pd
import pytest
from jerkbench.audit.verdicts import DEFAULTS, TUNED
from made_losses import JERK, losses

from experiment_scripts import EXPERIMENTS, experiment

of_paper = experiment("paper/claims.py")
ten_times = experiment("paper/ten_times.py")
CLAIMED = of_paper.CLAIMED
claim_frame, claim_table, where_it_holds = of_paper.claim_frame, of_paper.claim_table, of_paper.where_it_holds

SEEDS = 20


def found(**more):
    levels = dict(enumerate([0.02, 0.02, 0.02, 0.2, 0.2, 2.0]))
    return {(claim.name.split(":")[0], claim.setting): claim for claim in of_paper.audit_claims(losses(**more), levels)}


def test_ten_times_holds_where_the_ratio_is_below_a_tenth_and_nowhere_else():
    claim = found()["more than 10 times better than the baseline", TUNED]
    assert claim.words == ["does not hold", "holds", "does not hold"] * 2
    assert claim.numbers[1, 0] == pytest.approx(0.05, rel=0.02)
    assert claim.numbers[1, 1] < 0.05 < claim.numbers[1, 2]
    assert where_it_holds(claim) == "a"


def test_centimetres_are_of_the_error_in_metres():
    claim = found()["an error of centimetres (below 0.1 m)", TUNED]
    assert claim.words[:4] == ["holds", "holds", "holds", "does not hold"]
    assert claim.words[5] == "does not hold"
    assert where_it_holds(claim) == "none 1/2, a, b 1/2"


def test_resilience_is_asked_under_a_fault_only():
    claim = found()["resilient", DEFAULTS]
    assert [scenario.family for scenario in claim.scenarios] == ["a", "b", "a", "b"]
    assert where_it_holds(claim) == "everywhere"
    harmed = found(jerk={**JERK, "b": 1.5})["resilient", DEFAULTS]
    assert harmed.words == ["holds", "does not hold"] * 2


def test_the_table_and_the_frame_say_the_same():
    claimed = list(found().values())
    frame = claim_frame(claimed)
    assert len(frame) == 2 * (6 + 6 + 4)
    table = claim_table(claimed)
    assert "| more than 10 times better than the baseline | tuned | 2 of 6 | 4 of 6 | 0 of 6 |" in table
    assert (frame[(frame.setting == TUNED) & frame.claim.str.startswith("more")].verdict == "holds").sum() == 2


def test_without_its_methods_there_is_no_claim():
    known = losses()
    del known.by_kind[CLAIMED, DEFAULTS, 0]
    assert of_paper.audit_claims(known, dict.fromkeys(range(6), 1.0)) == []


FACTORS = {
    "dataset": "field",
    "attitude": "tilt",
    "noise": "default",
    "replicate": "seed",
    "status": "ok",
    "reason": "",
}


def rows(seeds, times):
    rng = np.random.default_rng(5)
    made = []
    for name, adaptation, factor in (("baseline", "none", 1.0), ("jerk", "none", 0.9), ("jerk", "mtf", 1 / times)):
        for disturbance in ("none", "bias"):
            values = factor * np.exp(0.1 * rng.standard_normal(seeds))
            head = {**FACTORS, "filter": name, "adaptation": adaptation, "disturbance": disturbance}
            made += [{**head, "seed": seed, "position_rmse_m": value} for seed, value in enumerate(values)]
    return pd.DataFrame(made)


def cell_rows(filter_name, adaptation, values):
    head = {**FACTORS, "filter": filter_name, "adaptation": adaptation, "disturbance": "none"}
    return [{**head, "seed": seed, "position_rmse_m": value} for seed, value in enumerate(values)]


@pytest.mark.parametrize(("factor", "word"), [(25.0, "It holds"), (2.0, "It does not hold"), (10.0, "It stays open")])
def test_the_papers_claim_is_judged(factor, word):
    rng = np.random.default_rng(2)
    base = np.exp(rng.normal(size=SEEDS))
    better = base / factor * np.exp(rng.normal(scale=0.3, size=SEEDS))
    rows = [*cell_rows("baseline", "none", list(base)), *cell_rows("jerk", "mtf", list(better))]
    (said,) = ten_times.claims(pd.DataFrame(rows))
    assert said.startswith(f"The paper says that jerk+mtf is more than 10 times better than baseline+none. {word}: ")
    assert ten_times.claims(pd.DataFrame(rows[:SEEDS])) == []


def test_few_seeds_neither_hold_a_claim_nor_refute_it():
    rng = np.random.default_rng(2)
    base = np.exp(rng.normal(size=3))
    rows = [*cell_rows("baseline", "none", list(base)), *cell_rows("jerk", "mtf", list(base / 30))]
    (said,) = ten_times.claims(pd.DataFrame(rows))
    assert "Seen: 30.0 times, over 3 runs, without an interval; 0 of 3 lost (up to 63 %)." in said


def test_a_study_says_of_each_opponent_in_how_many_cases_the_claim_holds():
    assert "it holds in 2" in ten_times.said(rows(20, 30.0))[0]


def test_where_nothing_is_shown_the_claim_does_not_hold_either():
    assert ten_times.said(rows(2, 12.0)) == [ten_times.NOTHING_SHOWN]


def test_the_section_of_an_audit_is_that_of_its_page():
    """The committed page has its table, and around it these words."""
    page = (EXPERIMENTS / "audit" / "README.md").read_text(encoding="utf-8")
    before, after = of_paper.SECTION.split("{table}")
    assert before in page
    assert after in page
