"""Ratios to a baseline, their marks and their sentences."""

import math
import re
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp, wilcoxon

from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.judgement import Verdict
from jerkbench.report.comparisons import VerdictRule, leaders_of, parse_baseline
from jerkbench.report.findings import findings, study_verdicts
from jerkbench.report.summary import summarise
from jerkbench.report.writers import html_table, latex, markdown, tidy_csv

METRIC = "position_rmse_m"
NONE = {"adaptation": "none"}
SEEDS = 20


def sentences(rows, metric=METRIC):
    return findings(rows, study_verdicts(rows, metric))


@pytest.fixture
def study(cell_rows):
    """On multipath mtf is 25 times better, a copy the same, and noise a matter of chance; 20 seeds."""
    rng = np.random.default_rng(1)
    base = np.exp(rng.normal(scale=0.3, size=SEEDS))
    cells = {
        ("jerk", "none"): base,
        ("jerk", "mtf"): base / 25 * np.exp(rng.normal(scale=0.2, size=SEEDS)),
        ("jerk", "copy"): base,
        ("jerk", "chance"): base * np.exp(rng.normal(scale=0.2, size=SEEDS)),
        ("baseline", "none"): 1.1 * base * np.exp(rng.normal(scale=0.02, size=SEEDS)),
    }
    rows = [row for key, values in cells.items() for row in cell_rows(*key, list(values))]
    return pd.DataFrame(rows).assign(disturbance="multipath")


def series(rows, filter_name, adaptation):
    chosen = rows[(rows["filter"] == filter_name) & (rows["adaptation"] == adaptation)]
    return chosen.sort_values("seed")["position_rmse_m"].to_numpy()


def against_none(rows, **options):
    """The comparisons with none by the adaptation."""
    return {one.subject[4]: one for one in study_verdicts(rows, METRIC, **options).against(NONE)}


def test_each_cell_meets_its_own_baseline_seed_by_seed_in_one_family(study):
    others = [study.assign(disturbance=f"bias{k}") for k in range(5)]
    assert against_none(pd.concat([*others, study]))["chance"].family == 6 * against_none(study)["chance"].family
    chance = study["adaptation"] == "chance"
    shifted = study.assign(**{METRIC: study[METRIC] * np.where(chance, np.exp(0.02 * study["seed"] - 0.1), 1.0)})
    alone, among = (against_none(rows)["chance"] for rows in (shifted, pd.concat([*others, shifted])))
    assert among.judgement.p >= alone.judgement.p
    found = against_none(study.sample(frac=1.0, random_state=3))
    assert {(one.subject[3], name) for name, one in found.items()} == {("jerk", name) for name in found}
    assert set(found) == {"mtf", "copy", "chance"}
    d = np.log(series(study, "jerk", "mtf") / series(study, "jerk", "none"))
    one, copy = found["mtf"], found["copy"]
    assert one.judgement.ratio == pytest.approx(math.exp(d.mean()))
    assert one.judgement.p == pytest.approx(1 / 2000)  # no resample's largest t is as large
    assert (one.verdict, one.mark) == (Verdict.BETTER, "*")
    assert found["chance"].verdict is Verdict.UNDECIDED
    assert (copy.verdict, copy.mark) == (Verdict.UNDECIDED, "")
    assert copy.judgement.reason == "more seeds are needed to exclude rare failures"
    wide = against_none(study, rule=VerdictRule(0.15))["copy"]
    assert (wide.verdict, wide.mark) == (Verdict.EQUAL, "=")


def test_a_lost_run_is_the_worst_of_its_pair_and_two_that_lost_all_are_not_compared(study):
    study.loc[(study["adaptation"] == "mtf") & (study["seed"] < 3), "status"] = "diverged"
    one = against_none(study)["mtf"]
    assert (one.judgement.n, one.runs, one.failed, one.judgement.median) == (20, 20, (3, 0), True)
    assert one.verdict is Verdict.UNDECIDED  # 25 times better in seventeen, lost in three
    (said,) = [line for line in sentences(study) if "jerk+mtf" in line]
    assert said.endswith("; 3 of 20 failed (up to 34 %) against 0 of 20 failed (up to 14 %).")
    both = study[study["adaptation"].isin(["mtf", "none"]) & (study["filter"] == "jerk")].assign(status="diverged")
    assert sentences(both) == ["mtf cannot be compared with none: all 20 runs of both failed."]


@pytest.mark.parametrize("lost", [12, 20])
def test_twelve_lost_of_twenty_runs_are_no_finding_in_favour(study, lost):
    """The survivors alone are 25 times better."""
    study.loc[(study["adaptation"] == "mtf") & (study["seed"] < lost), "status"] = "diverged"
    assert against_none(study)["mtf"].verdict is Verdict.MORE_FAILED
    (said,) = [line for line in sentences(study) if line.startswith("jerk+mtf")]
    assert said.startswith(f"jerk+mtf fails in more runs than jerk+none (20 seeds); {lost} of 20 failed (up to ")
    table = summarise(study, METRIC, baseline=NONE)
    (cell,) = [c for key, c in zip(table.columns, table.cells[0], strict=True) if key == ("mtf",)]
    assert lost == 20 or cell.text == f"failed {cell.interval} {cell.geometric_text} * (12/20 diverged)"


def test_skewed_differences_of_equal_means_are_rarely_shown(cell_rows):
    """Wilcoxon, which tests symmetry, errs in over a quarter of such studies; here the mean log ratio is what is said.

    300 studies of 20 seeds: 5 % have a standard error of 1.3 %.
    """
    rng = np.random.default_rng(7)
    shown, by_ranks = 0, 0
    for _ in range(300):
        d = 0.1 * (np.exp(rng.standard_normal(20)) - math.exp(0.5))
        rows = pd.DataFrame([*cell_rows("jerk", "none", [1.0] * 20), *cell_rows("jerk", "a", list(np.exp(d)))])
        (one,) = study_verdicts(rows, "position_rmse_m").against(NONE)
        shown += one.shown
        by_ranks += wilcoxon(d).pvalue < 0.05
    assert by_ranks / 300 > 0.2
    assert shown / 300 < by_ranks / 300 / 2


def test_tuned_against_tuned_is_a_comparison(study):
    """Two filters, each with a noise of its own: with the noise a part of the method they are rivals."""
    tuned = study.assign(noise=np.where(study["filter"] == "jerk", "accel_mps2=0.1", "accel_mps2=0.5"))
    tuned = tuned[tuned["adaptation"].isin(["none", "mtf"])]
    (scene,) = study_verdicts(tuned, "position_rmse_m").standings
    names = {(one.subject[3], one.subject[5]) for one in scene.comparisons}
    assert ("jerk", "accel_mps2=0.1") in names
    (against,) = [
        one for one in scene.comparisons if one.subject[3:5] == ("jerk", "none") and one.baseline[3] == "baseline"
    ]
    assert against.subject[5] != against.baseline[5]
    assert against.verdict is Verdict.BETTER
    assert [leader[3:5] for leader in leaders_of(scene.rivals, scene.comparisons)] == [("jerk", "mtf")]
    apart = study_verdicts(tuned, "position_rmse_m", ("filter", "adaptation")).standings
    assert all(len({one[5] for one in scene.rivals}) == 1 for scene in apart)


def test_phases_have_a_range_and_no_test(study):
    phases = study.assign(replicate="phase")
    one = against_none(phases)["mtf"]
    ratios = series(study, "jerk", "mtf") / series(study, "jerk", "none")
    assert (one.judgement.low, one.judgement.high) == pytest.approx((ratios.min(), ratios.max()))
    assert math.isnan(one.judgement.p)
    assert not one.shown
    (said,) = [line for line in sentences(phases) if "mtf" in line]
    assert "times better than jerk+none (range" in said
    assert "20 phases of one recording; no test" in said
    (said,) = [line for line in sentences(phases[phases["seed"] == 0]) if "mtf" in line]
    assert "(one run of one recording; no test)" in said


def test_the_table_has_ratios_marks_and_what_they_mean_and_html_escapes(study):
    table = summarise(study, METRIC, baseline=NONE)
    cells = {key[0]: cell for key, cell in zip(table.columns, table.cells[0], strict=True)}
    assert "×0.0" in cells["mtf"].text  # noqa: RUF001
    assert cells["mtf"].text.endswith("*")
    assert cells["copy"].text.endswith("×1.00")  # noqa: RUF001
    assert "×" not in cells["none"].text  # noqa: RUF001
    said = " ".join(table.footnotes)
    for words in (
        "ratio to adaptation=none over the common seeds",
        "At most 5 % of such studies have any wrong mark (max-t test of all 10 comparisons",
        "Undecided: 2 of 3.",
        "Runs of each method: 0 of 20 failed (up to 14 %).",
    ):
        assert words in said
    assert not any("ratio" in note for note in summarise(study, METRIC).footnotes)
    factor = cells["mtf"].factor
    assert factor in markdown(table)
    assert f'<span class="factor">{factor}</span>' in html_table(table)
    assert "$\\times$" + factor[1:] in latex(table)
    assert "ratio,ratio_low,ratio_high,p" in tidy_csv([table]).splitlines()[0]
    text = html_table(summarise(study.replace("copy", "<b>&"), "position_rmse_m", notes=("a < b",)))
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;" in text
    assert text.count("<strong>") == 1
    assert "<li>a &lt; b</li>" in text


def test_findings_say_what_was_shown_and_what_was_not_the_largest_first(study):
    best, second, *others = sentences(study)
    d = -np.log(series(study, "jerk", "mtf") / series(study, "jerk", "none"))
    assert best.startswith(f"jerk+mtf is {math.exp(d.mean()):.1f} times better than jerk+none (95 % ")
    low, high = map(float, best.split("(95 % ")[1].split(",")[0].split(" to "))
    assert low < math.exp(d.mean()) < high
    assert "20 seeds" in best
    assert second.startswith("jerk+none is 1.10 times better than baseline+none (95 %")
    (open_one,) = [line for line in others if line.startswith("Undecided between jerk+chance and jerk+none: ")]
    assert re.search(r"\(95 % [\d.]+ to [\d.]+, 20 seeds\); 0 of 20 failed \(up to 14 %\)\.$", open_one)
    assert "jerk+copy gives the same as jerk+none (20 seeds); 0 of 20 failed (up to 14 %)." in others
    assert len(others) == 2
    assert sentences(study.assign(anees=6.0), "anees") == []


@pytest.mark.parametrize("replicate", ["seed", "phase"])
@pytest.mark.parametrize("lost", [11, 15, 20])
def test_a_lost_median_has_no_infinite_ratio(study, replicate, lost):
    for name, first in (("mtf", 0), ("chance", SEEDS - lost)):
        chosen = (study["adaptation"] == name) & study["seed"].between(first, first + lost - 1)
        study.loc[chosen, "status"] = "diverged"
    lines = sentences(study.assign(replicate=replicate), "position_rmse_m")
    assert not any(word in line for line in lines for word in ("inf times", "to inf", "inf to", "nan"))


@pytest.mark.parametrize(
    ("seeds", "begin", "end"),
    [
        (100, "a and none are equal within 3 %: ", "100 seeds); 0 of 100 failed (up to 3.0 %)."),
        (
            20,
            "Undecided between a and none: ",
            ", because more seeds are needed to exclude rare failures; 0 of 20 failed (up to 14 %).",
        ),
    ],
)
def test_what_is_equal_is_said_where_losses_that_were_not_seen_are_excluded(cell_rows, seeds, begin, end):
    base = np.exp(np.random.default_rng(3).normal(scale=0.3, size=seeds))
    near = base * np.exp(np.random.default_rng(4).normal(scale=0.01, size=seeds))
    (said,) = sentences(pd.DataFrame([*cell_rows("jerk", "none", base), *cell_rows("jerk", "a", near)]))
    assert re.match(rf"{begin}(1\.00|0\.99\d|1\.01) times \(95 % ", said)
    assert said.endswith(end)


def test_seeds_are_named_where_seeds_can_show_a_difference(cell_rows):
    """Of twelve comparisons one is nearly shown: its own interval excludes 1, that of the study does not."""
    rng = np.random.default_rng(5)
    cells = {f"a{k}": np.exp(rng.normal(scale=0.1, size=SEEDS)) for k in range(12)}
    base = np.ones(SEEDS)
    near = rng.normal(size=SEEDS)
    near = 0.058 + 0.1 * (near - near.mean()) / near.std(ddof=1)
    cells |= {"none": base, "near": np.exp(near)}
    rows = pd.DataFrame([row for name, values in cells.items() for row in cell_rows("jerk", name, list(values))])
    lines = sentences(rows, "position_rmse_m")
    (said,) = [line for line in lines if "near" in line]
    assert re.search(r"^Undecided between near and none: 1\.06 times .*; \d+ seeds would decide; 0 of 20 failed", said)
    told = {line.split()[2] for line in lines if "would decide" in line}
    assert told == {
        name for name, values in cells.items() if name != "none" and ttest_1samp(np.log(values), 0).pvalue < 0.05
    }


def test_a_baseline_is_read_and_a_wrong_one_is_a_sentence(study):
    assert parse_baseline("filter=baseline,adaptation=none") == {"filter": "baseline", "adaptation": "none"}
    assert parse_baseline("filter=jerk(a=1, b=2);noise=default") == {"filter": "jerk(a=1, b=2)", "noise": "default"}
    with pytest.raises(JerkbenchError, match="not of the form FACTOR=NAME"):
        parse_baseline("none")
    with pytest.raises(JerkbenchError, match=r"no factor 'filtr'. Did you mean 'filter'"):
        parse_baseline("filtr=jerk")
    with pytest.raises(JerkbenchError, match=r"no adaptation 'nome'. Did you mean 'none'"):
        study_verdicts(study, "position_rmse_m").against({"adaptation": "nome"})
    with pytest.raises(JerkbenchError, match="filter=baseline, adaptation=mtf"):
        study_verdicts(study, "position_rmse_m").against({"filter": "baseline", "adaptation": "mtf"})


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not there")
def test_latex_compiles_and_fits_its_page(study, tmp_path):
    lost = study.copy()
    lost.loc[lost["adaptation"] == "chance", "status"] = "diverged"
    tiny = lost.assign(position_rmse_m=lost["position_rmse_m"].where(lost["adaptation"] != "copy", 1e-7))
    text = latex(summarise(tiny, "position_rmse_m", baseline=NONE, notes=("100% of R_k & {x} #1 ~ ^ <$> ± σ",)))  # noqa: RUF001
    packages = r"\usepackage[T1]{fontenc}\usepackage{booktabs,siunitx}"
    (tmp_path / "t.tex").write_text(
        rf"\documentclass{{article}}{packages}\begin{{document}}{text}\end{{document}}", encoding="utf-8"
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "t.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    if "siunitx.sty' not found" in done.stdout:
        pytest.skip("siunitx is not there")
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Package siunitx" not in done.stdout
    assert "Float too large" not in done.stdout
    assert "Overfull \\vbox" not in done.stdout
