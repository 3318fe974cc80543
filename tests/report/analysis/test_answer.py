"""The answer in one sentence, and the findings by size and certainty."""

import math
import re

import numpy as np
import pandas as pd
import pytest

from jerkbench.evaluation.judgement import Verdict
from jerkbench.report.findings import LOG_RATIO_ALL_FAILED, answer, certain_size, findings, study_verdicts

SCENES = ("none", "bias", "gnss_outage")


@pytest.fixture
def study(cell_rows):
    def make(factors, seeds=20, adaptation="none", scenes=SCENES):
        """Errors of each filter: its factor in each scenario, times what all share, times a spread of its own."""
        rng = np.random.default_rng(3)
        made = []
        for place, scene in enumerate(scenes):
            shared = np.exp(0.5 * rng.standard_normal(seeds))
            for name, of in factors.items():
                values = of[place] * shared * np.exp(0.02 * rng.standard_normal(seeds))
                made += cell_rows(name, adaptation, values, disturbance=scene)
        return pd.DataFrame(made)

    return make


def said(rows):
    return answer(study_verdicts(rows, "position_rmse_m").standings)


BASIS = "Each comparison uses 20 seeds; 0 of 20 failed (up to 14 %)."


def test_of_two_methods_it_says_who_leads_how_often(study):
    told = said(study({"gauss": (0.5, 0.8, 1.0), "jerk": (1.0, 1.0, 1.0)}))
    assert told.title.startswith("Of 2 methods, gauss leads in 2 of 3 scenarios and is up to 2.")
    assert told.sentences == ("No significant difference between competing methods on gnss_outage.", BASIS)
    told = said(study({"gauss": (2.0, 0.8, 3.0), "jerk": (1.0, 1.0, 1.0)}))
    assert told.title.startswith("Of 2 methods, jerk leads in 2 of 3 scenarios and is up to 2.9")


def test_of_two_methods_in_one_scenario_it_says_by_how_much(study):
    told = said(study({"gauss": (0.5,), "jerk": (1.0,)}, scenes=("none",)))
    assert told.title.startswith("Of 2 methods, gauss leads and is ")
    assert float(told.title.split()[-5]) == pytest.approx(2.0, rel=0.03)
    equal = said(study({"gauss": (1.0,), "jerk": (1.0,)}, scenes=("none",), seeds=120))
    assert equal.title == "Both methods are equal within 3 %"
    assert equal.sentences == ("Each comparison uses 120 seeds; 0 of 120 failed (up to 2.5 %).",)


def test_of_several_methods_it_names_the_leader_and_where_nothing_differs(study):
    told = said(study({"gauss": (0.5, 0.5, 4.0), "jerk": (1.0, 1.0, 2.0), "baseline": (2.0, 2.0, 1.0)}))
    begin, times = told.title.split(" and is up to ")
    assert begin == "Of 3 methods, gauss leads in 2 of 3 scenarios"
    assert times.endswith(" times better than baseline")
    assert float(times.split()[0]) == pytest.approx(4.0, rel=0.03)
    assert told.sentences == (BASIS,)
    told = said(study({"gauss": (0.5, 0.5, 1.0), "jerk": (1.0, 1.0, 1.0), "baseline": (2.0, 2.0, 1.0)}))
    assert told.sentences == ("No significant difference between competing methods on gnss_outage.", BASIS)


def test_of_leaders_that_tie_the_one_with_the_lowest_error_comes_first(study):
    told = said(study({"none": (1.0, 1.0), "far": (0.1, 0.9), "near": (0.9, 0.2)}, scenes=SCENES[:2]))
    assert told.title.startswith("Of 3 methods, far and near lead in 1 of 2 scenarios; far is up to ")
    told = said(study({"none": (1.0, 1.0), "far": (0.2, 0.9), "near": (0.9, 0.1)}, scenes=SCENES[:2]))
    assert told.title.startswith("Of 3 methods, near and far lead in 1 of 2 scenarios; near is up to ")
    factors = {"gauss": (0.5, 0.5), "jerk": (1.0, 0.5), "baseline": (2.0, 2.0)}
    rows = study(factors, scenes=SCENES[:2])
    told = said(rows)
    assert told.title.startswith("Of 3 methods, gauss leads in 1 of 2 scenarios and is up to ")
    both = study({**factors, "jerk": (0.5, 0.5)}, scenes=SCENES[:2])
    assert said(both).title.startswith("Of 3 methods, ")
    assert " share the lead in 2 of 2 scenarios; " in said(both).title


def test_the_reference_is_the_tuned_baseline_and_of_several_settings_the_best(study, cell_rows):
    factors = {"baseline": (9.0, 9.0), "baseline, tuned": (3.0, 3.0), "jerk, tuned": (1.0, 1.0)}
    told = said(study(factors, scenes=SCENES[:2]))
    begin, times = told.title.split(" and is up to ")
    assert begin == "Of 3 methods, jerk, tuned leads in 2 of 2 scenarios"
    assert times.endswith(" times better than baseline, tuned")
    assert float(times.split()[0]) == pytest.approx(3.0, rel=0.03)

    rng = np.random.default_rng(5)
    shared = np.exp(0.5 * rng.standard_normal(20))
    settings = [("baseline", "accel_mps2=0.05", 8.0), ("baseline", "accel_mps2=1", 2.0), ("jerk", "default", 1.0)]
    rows = [
        row
        for name, noise, factor in settings
        for row in cell_rows(name, "none", factor * shared * np.exp(0.02 * rng.standard_normal(20)), noise=noise)
    ]
    title = said(pd.DataFrame(rows)).title
    assert title.startswith("Of 3 methods, jerk")
    assert title.endswith(" times better than baseline+accel_mps2=1")
    assert float(title.split(" and is ")[1].split()[0]) == pytest.approx(2.0, rel=0.03)


def test_a_significant_difference_within_the_margin_is_neither_a_win_nor_undecided(study):
    rows = study({"gauss": (0.985, 0.985), "jerk": (1.0, 1.0)}, scenes=SCENES[:2], seeds=60)
    told = said(rows)
    assert told.title == "Both methods differ by less than 3 %"
    one = rows[rows["disturbance"] == "none"]
    assert said(one).title == "Both methods differ by less than 3 %"
    standings = study_verdicts(one, "position_rmse_m").standings
    assert findings(one, study_verdicts(one, "position_rmse_m"))[0].startswith(
        "gauss and jerk differ by less than 3 %: 0.9"
    )
    assert not standings[0].decided


def test_few_seeds_one_method_and_phases_show_nothing_and_it_says_so(study):
    rows = study({"gauss": (0.5, 0.5, 4.0), "jerk": (1.0, 1.0, 2.0), "bias": (2.0, 2.0, 1.0)}, seeds=2)
    told = said(rows)
    assert told.title == "None of 3 methods is significantly better than another in any of 3 scenarios"
    assert told.sentences == ("Each comparison uses 2 seeds; 0 of 2 failed (up to 78 %).",)
    standings = study_verdicts(rows, "position_rmse_m").standings
    assert all(pair.verdict is Verdict.UNDECIDED for standing in standings for pair in standing.tested)
    rows = study({"jerk": (1.0, 1.0, 1.0)})
    assert "no methods are compared" in said(rows).title
    phases = study({"jerk": (1.0,), "bias": (2.0,)}, scenes=("none",)).assign(replicate="phase")
    assert said(phases).title.startswith("Nothing is tested")


def test_the_largest_finding_comes_first_and_only_one_factor_differs(study):
    factors = {"baseline": (1.0, 1.0, 1.0), "jerk": (0.9, 0.9, 0.9), "bias": (0.1, 0.2, 0.3)}
    rows = pd.concat([study(factors), study({k: [4 * x for x in v] for k, v in factors.items()}, adaptation="mtf")])
    told = findings(rows, study_verdicts(rows, "position_rmse_m"))
    pairs = [line.split(" (")[0] for line in told]
    assert re.fullmatch(r"bias\+(none|mtf) is \d+\.\d times better than baseline\+(none|mtf) on none", pairs[0])
    assert not any(re.search(r"jerk\+.*(than|and) bias\+|bias\+.*(than|and) jerk\+", pair) for pair in pairs)
    assert len(told) == 3 * 7  # two filters against the baseline with two adaptations, three with mtf against none
    every = findings(rows, study_verdicts(rows, "position_rmse_m"), every=True)
    assert len(every) == len(set(every)) == 3 * 15  # all pairs of six methods in three scenarios
    assert set(told) <= set(every)


def test_without_a_baseline_all_pairs_of_methods_are_compared(cell_rows):
    rng = np.random.default_rng(3)
    rows = pd.DataFrame(
        [row for name in ("a", "b", "c") for row in cell_rows(name, f"of_{name}", np.exp(rng.standard_normal(20)))]
    )

    assert len(findings(rows, study_verdicts(rows, "position_rmse_m"))) == 3


@pytest.mark.parametrize(("verdict", "ratio"), [(Verdict.BETTER, 0.0), (Verdict.WORSE, math.inf)])
def test_where_the_median_run_of_one_is_lost_there_is_a_weight(judgement, verdict, ratio):
    lost = judgement(verdict, ratio, ratio, ratio, (0, 17))
    assert certain_size(lost) == LOG_RATIO_ALL_FAILED
    half = judgement(Verdict.WORSE, 8.0, 2.0, math.inf, (6, 0))  # the other end remains
    assert certain_size(half) == pytest.approx(math.log(2.0))
