"""Verdicts from rows whose answer is known: made by hand, no filter runs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.stages import Search
from jerkbench.audit.verdicts import probability_below, verdicts

from jerkbench.audit.campaign import Outcome
from jerkbench.audit.figures import model_figure, ratios_by_adaptation
from jerkbench.audit.page import audit_page
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.study import contents_of, judged_audit
from jerkbench.campaigns.protocol import FaultFamily
from jerkbench.campaigns.ratios import ratio_verdict
from jerkbench.campaigns.search import ALL
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.evaluation.statistics.ranks import over_scenarios

HALF = {"none": "both", "a": "first", "b": "first", "c": "second", "d": "second"}
PROTOCOL = AuditProtocol(
    version=1,
    duration_s=60.0,
    fields={"white": "field_white"},
    filters=("baseline",),
    plain="none",
    references=("oracle",),
    trials=2,
    restarts=1,
    finalists=1,
    tune_seeds=1,
    choose_seeds=1,
    test_seeds=12,
    margin=0.03,
    families=tuple(FaultFamily(name, half, "none", {"usual": {}}) for name, half in HALF.items()),
    adaptations=("mtf", "chi2"),
)
SCENARIOS = PROTOCOL.scenarios
FACTORS = {
    "none": {0: 2.0, 1: 1.0, 2: 1.0, 3: 1.0},
    "mtf": {0: 3.0, 1: 0.5, 2: 0.7, 3: 0.4},
    "chi2": {0: 1.0, 1: 1.0, 2: 1.0, 3: 1.0},
}
"""Error of each trial over the tuned plain filter's: 0 the defaults, 1 tuned on first, 2 on second, 3 the bound."""


def outcome(lost=()):
    rng = np.random.default_rng(3)
    rows = []
    for number in range(len(SCENARIOS)):
        for seed in PROTOCOL.seeds_to_test_on:
            common = np.exp(rng.normal(0.0, 0.3))
            for adaptation, factors in FACTORS.items():
                for trial, factor in factors.items():
                    away = (number, adaptation, trial) in lost
                    rows.append(
                        {
                            "scenario": number,
                            "filter": "baseline",
                            "adaptation": adaptation,
                            "trial": trial,
                            "seed": seed,
                            "status": "diverged" if away else "ok",
                            "position_rmse_m": np.nan if away else 0.1 * common * factor,
                            "anees": 6.0,
                            "seconds": 0.001,
                        }
                    )
    methods = [AuditMethod("baseline", name) for name in FACTORS]
    trial = {Search(m, half, 0): k for m in methods for half, k in (("first", 1), ("second", 2), (ALL, 1))}
    return Outcome(dict.fromkeys(trial, ()), trial, dict.fromkeys(methods, 3), pd.DataFrame(rows))


def judged(**more):
    return {verdict.method.adaptation: verdict for verdict in verdicts(outcome(**more), PROTOCOL, SCENARIOS)}


def test_a_setting_is_scored_on_the_half_that_its_search_has_not_seen():
    """a and b (first half) take .7 of the search on second, c and d .5 of that on first, `none` the mean of both."""
    log = np.mean([np.log(0.7), np.log(0.7), np.log(0.5), np.log(0.5), (np.log(0.7) + np.log(0.5)) / 2])
    mtf = judged()["mtf"]
    assert mtf.tuned.ratio == pytest.approx(np.exp(log), rel=1e-12)
    assert mtf.nominal == pytest.approx(np.sqrt(0.35), rel=1e-12)
    assert mtf.worst_ratio == pytest.approx(0.7, rel=1e-12)
    assert mtf.default == pytest.approx(3.0, rel=1e-12)
    assert mtf.bound == pytest.approx(0.4, rel=1e-12)


def test_what_is_the_same_is_equal_and_what_halves_the_error_is_better():
    found = judged()
    assert found["mtf"].verdict is Verdict.BETTER
    assert found["mtf"].p_better > 0.99
    assert found["chi2"].verdict is Verdict.EQUAL
    assert found["mtf"].places[0] == 1


def test_a_lost_run_counts_a_hundred_times_the_level():
    """Of scenario 1 (family a) with the setting of the second half, trial 2."""
    mtf = judged(lost={(1, "mtf", 2)})["mtf"]
    assert mtf.worst_ratio == pytest.approx(200.0)  # the level is that of the defaults, twice the tuned plain filter's
    assert mtf.lost == pytest.approx(1 / 6)  # six settings are scored over five scenarios: `none` has two
    assert mtf.verdict is not Verdict.BETTER


@pytest.mark.parametrize(
    ("low", "high", "word"),
    [
        (0.5, 0.9, "better"),
        (0.98, 1.02, "equal"),
        (1.1, 1.2, "worse"),
        (0.9, 1.1, "undecided"),
        (0.96, 1.0, "undecided"),
    ],
)
def test_an_interval_has_one_word(low, high, word):
    assert ratio_verdict(low, high, 0.03) == Verdict(word)


def test_the_probability_is_that_of_the_interval():
    """Half of it lies below the mean, 2.5 % below the lower end of the 95 % interval."""
    mean = over_scenarios(np.random.default_rng(1).normal(-0.2, 0.1, (6, 12)))
    assert probability_below(mean, mean.ratio) == pytest.approx(0.5)
    assert probability_below(mean, mean.low) == pytest.approx(0.025, rel=1e-6)


def test_the_page_says_what_the_verdicts_say():
    audit = judged_audit(PROTOCOL, outcome(), SCENARIOS)
    text = audit_page(contents_of(audit, "small"))
    head = text.splitlines()[:10]
    answer = "1 of 2 are shown to beat a tuned Kalman filter on average over all faults. 1 of these are nowhere"
    assert any(answer in line for line in head)
    assert any("on faults that it was not tuned on, by 0.50 (0.50 to 0.50) (baseline)." in line for line in head)
    assert any(
        "the tuned error of 0 of 2 is more than 3 % higher" in line and "0 of 2 are more than 3 % worse" in line
        for line in head
    )
    assert "baseline + mtf" in text
    assert PROTOCOL.digest in text
    assert "1 better, 1 equal" in text
    assert "**c**: 1 of 2 better, 0 worse; the lowest ratio has baseline + mtf with 0.50." in text
    assert "## How sure" in audit_page(contents_of(audit, "small", "## Mine\n\nSo it is.\n")).split("So it is.")[1]


def test_the_page_shows_text_as_text_and_takes_sections_as_they_are():
    contents = contents_of(
        judged_audit(PROTOCOL, outcome(), SCENARIOS), "<script>x</script>", "## Mine\n\n![a](b.png)\n"
    )
    text = audit_page(replace(contents, sentences=[*contents.sentences, "![x](http://y)"]))
    assert r"\<script>x\</script>" in text
    assert r"!\[x](http://y)" in text
    assert "\n![a](b.png)" in text


def test_each_adaptation_stands_once_with_all_its_models_the_best_first():
    """By hand: geometric means of (0.5, 2) and (0.9, 0.9) are 1 and 0.9."""
    judged = {("mtf", "baseline"): 0.5, ("mtf", "jerk"): 2.0, ("chi2", "baseline"): 0.9, ("chi2", "jerk"): 0.9}
    known = [
        SimpleNamespace(method=AuditMethod(model, adaptation), tuned=SimpleNamespace(ratio=ratio))
        for (adaptation, model), ratio in judged.items()
    ]
    ratios = ratios_by_adaptation(known)
    assert list(ratios) == ["chi2", "mtf"]
    assert ratios["mtf"] == {"baseline": 0.5, "jerk": 2.0}
    (axes,) = model_figure(known, 0.03).axes
    assert [text.get_text() for text in axes.get_yticklabels()] == ["chi2", "mtf"]
