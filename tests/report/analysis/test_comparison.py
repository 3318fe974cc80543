"""Ratios to a baseline, their marks and their sentences."""

import math
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest
from scipy.stats import wilcoxon

from jerkbench.errors import JerkbenchError
from jerkbench.report.analysis.comparison import compare_to, parse_baseline
from jerkbench.report.analysis.findings import findings
from jerkbench.report.analysis.paper_claim import claims
from jerkbench.report.tables.csv import tidy_csv
from jerkbench.report.tables.html import html_table
from jerkbench.report.tables.latex import latex
from jerkbench.report.tables.markdown import markdown
from jerkbench.report.tables.study_tables import summarise

NONE = {"adaptation": "none"}
SEEDS = 20


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


def test_each_cell_meets_its_own_baseline_seed_by_seed(study):
    shuffled = study.sample(frac=1.0, random_state=3)
    found = {(one.subject[3], one.subject[4]): one for one in compare_to(shuffled, "position_rmse_m", NONE)}
    assert set(found) == {("jerk", "mtf"), ("jerk", "copy"), ("jerk", "chance")}
    d = np.log(series(study, "jerk", "mtf") / series(study, "jerk", "none"))
    one = found["jerk", "mtf"]
    assert one.paired.ratio == pytest.approx(math.exp(d.mean()))
    assert one.p == pytest.approx(3 * wilcoxon(d).pvalue)  # the smallest of three
    assert one.shown
    assert not found["jerk", "chance"].shown
    assert (found["jerk", "copy"].paired.ratio, found["jerk", "copy"].p) == (1.0, 1.0)


def test_a_scenario_is_a_family_of_its_own(study):
    two = pd.concat([study, study.assign(disturbance="bias")])
    alone = compare_to(study, "position_rmse_m", NONE)
    assert [one.p for one in compare_to(two, "position_rmse_m", NONE)] == [one.p for one in alone] * 2


def test_a_run_that_was_lost_in_either_is_no_pair(study):
    lost = (study["adaptation"] == "mtf") & (study["seed"] < 3)
    study.loc[lost, "status"] = "diverged"
    one = next(one for one in compare_to(study, "position_rmse_m", NONE) if one.subject[4] == "mtf")
    assert (one.paired.n, one.runs, one.lost, one.lost_baseline) == (17, 20, 3, 0)


def test_phases_have_a_range_and_no_test(study):
    found = compare_to(study.assign(replicate="phase"), "position_rmse_m", NONE)
    one = next(one for one in found if one.subject[4] == "mtf")
    ratios = series(study, "jerk", "mtf") / series(study, "jerk", "none")
    assert (one.paired.low, one.paired.high) == pytest.approx((ratios.min(), ratios.max()))
    assert math.isnan(one.p)
    assert not one.shown
    (said,) = [line for line in findings(study.assign(replicate="phase"), "position_rmse_m") if "mtf" in line]
    assert "times better than jerk+none (range" in said
    assert "20 phases of one recording; no test" in said


def test_the_table_has_ratios_stars_and_what_they_mean(study):
    table = summarise(study, "position_rmse_m", baseline=NONE)
    texts = {key: cell.text for key, cell in zip(table.columns, table.cells[0], strict=True)}
    assert "×0.0" in texts[("mtf",)]  # noqa: RUF001
    assert texts[("mtf",)].endswith("*")
    assert texts[("copy",)].endswith("×1.00")  # noqa: RUF001
    assert "×" not in texts[("none",)]  # noqa: RUF001
    said = " ".join(table.footnotes)
    assert "ratio to adaptation=none over the seeds that went well in both" in said
    assert "Holm over the up to 3 comparisons of a scenario" in said
    assert "cannot show" not in said
    plain = summarise(study, "position_rmse_m")
    assert not any("ratio" in note for note in plain.footnotes)


def test_too_few_seeds_for_any_difference_are_said(study):
    few = summarise(study[study["seed"] < 5], "position_rmse_m", baseline=NONE)
    assert any("5 seeds cannot show any; 7 could." in note for note in few.footnotes)
    enough = compare_to(study[study["seed"] < 7], "position_rmse_m", NONE)
    assert next(one for one in enough if one.subject[4] == "mtf").shown
    less = compare_to(study[study["seed"] < 6], "position_rmse_m", NONE)
    assert not next(one for one in less if one.subject[4] == "mtf").shown


def test_findings_say_what_was_shown_and_what_was_not(study):
    lines = findings(study, "position_rmse_m")
    d = -np.log(series(study, "jerk", "mtf") / series(study, "jerk", "none"))
    (best,) = [line for line in lines if line.startswith("jerk+mtf")]
    assert best.startswith(f"jerk+mtf is {math.exp(d.mean()):.1f} times better than jerk+none (95 % ")
    low, high = map(float, best.split("(95 % ")[1].split(",")[0].split(" to "))
    assert low < math.exp(d.mean()) < high
    assert "20 seeds" in best
    assert any(line.startswith("No difference was shown between jerk+chance and jerk+none") for line in lines)
    assert any(line.startswith("jerk+copy gives the same as jerk+none (20 seeds)") for line in lines)
    assert any(line.startswith("jerk+none is 1.10 times better than baseline+none (95 %") for line in lines)
    assert findings(study.assign(anees=6.0), "anees") == []


def test_a_finding_of_too_few_seeds_says_that_nothing_could_be_shown(study):
    few = findings(study[study["seed"] < 3], "position_rmse_m")
    (said,) = [line for line in few if "jerk+mtf and jerk+none" in line]
    assert said.startswith("3 seeds cannot show any difference between jerk+mtf and jerk+none (7 could): 0.0")
    assert not any("No difference was shown" in line for line in few)
    (one,) = [line for line in findings(study[study["seed"] < 1], "position_rmse_m") if "jerk+mtf and" in line]
    assert one.startswith("1 seed cannot show any difference between jerk+mtf and jerk+none (7 could): 0.0")
    assert not any("cannot show" in line for line in findings(study, "position_rmse_m"))


def test_who_lost_runs_may_still_be_shown_where_holm_lets_it(study):
    """Six pairs are too few for the smallest p of a family of three, and enough for a larger one."""
    lost = (study["adaptation"] == "mtf") & (study["seed"] >= 6)
    study.loc[lost, "status"] = "diverged"
    found = {one.subject[4]: one for one in compare_to(study, "position_rmse_m", NONE)}
    assert found["mtf"].needed == 0
    study.loc[(study["adaptation"] == "mtf") & (study["seed"] >= 5), "status"] = "diverged"
    found = {one.subject[4]: one for one in compare_to(study, "position_rmse_m", NONE)}
    assert (found["mtf"].needed, found["chance"].needed) == (7, 0)


@pytest.mark.parametrize(("factor", "word"), [(25.0, "It holds"), (2.0, "It does not hold"), (10.0, "It stays open")])
def test_the_papers_claim_is_judged(cell_rows, factor, word):
    rng = np.random.default_rng(2)
    base = np.exp(rng.normal(size=SEEDS))
    better = base / factor * np.exp(rng.normal(scale=0.3, size=SEEDS))
    rows = [*cell_rows("baseline", "none", list(base)), *cell_rows("jerk", "mtf", list(better))]
    (said,) = claims(pd.DataFrame(rows))
    assert said.startswith(f"The paper says that jerk+mtf is more than 10 times better than baseline+none. {word}: ")
    assert claims(pd.DataFrame(rows[:SEEDS])) == []


def test_all_lost_is_a_sentence(study):
    study.loc[study["adaptation"] == "mtf", "status"] = "diverged"
    assert "jerk+mtf cannot be compared with jerk+none: jerk+mtf lost 20 of 20 runs." in findings(
        study, "position_rmse_m"
    )


def test_a_baseline_is_read_and_a_wrong_one_is_a_sentence(study):
    assert parse_baseline("filter=baseline,adaptation=none") == {"filter": "baseline", "adaptation": "none"}
    assert parse_baseline("filter=jerk(a=1, b=2);noise=own") == {"filter": "jerk(a=1, b=2)", "noise": "own"}
    with pytest.raises(JerkbenchError, match="not of the form FACTOR=NAME"):
        parse_baseline("none")
    with pytest.raises(JerkbenchError, match=r"no factor 'filtr'. Did you mean 'filter'"):
        parse_baseline("filtr=jerk")
    with pytest.raises(JerkbenchError, match=r"no adaptation 'nome'. Did you mean 'none'"):
        compare_to(study, "position_rmse_m", {"adaptation": "nome"})
    with pytest.raises(JerkbenchError, match="No combination has filter=baseline, adaptation=mtf together"):
        compare_to(study, "position_rmse_m", {"filter": "baseline", "adaptation": "mtf"})


def test_every_format_has_the_ratio(study):
    table = summarise(study, "position_rmse_m", baseline=NONE)
    factor = next(cell for key, cell in zip(table.columns, table.cells[0], strict=True) if key == ("mtf",)).factor
    assert factor in markdown(table)
    assert f'<span class="factor">{factor}</span>' in html_table(table)
    assert "$\\times$" + factor[1:] in latex(table)
    assert "ratio,ratio_low,ratio_high,p" in tidy_csv([table]).splitlines()[0]


def test_html_escapes_and_marks_the_best(study):
    text = html_table(summarise(study.replace("copy", "<b>&"), "position_rmse_m", notes=("a < b",)))
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;" in text
    assert text.count("<strong>") == 1
    assert "<li>a &lt; b</li>" in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not there")
@pytest.mark.parametrize("scenarios", [1, 30])
def test_latex_compiles_and_fits_its_pages(study, tmp_path, scenarios):
    lost = pd.concat([study.assign(disturbance=f"d{k:02}") for k in range(scenarios)])
    lost.loc[lost["adaptation"] == "chance", "status"] = "diverged"
    tiny = lost.assign(position_rmse_m=lost["position_rmse_m"].where(lost["adaptation"] != "copy", 1e-7))
    text = latex(summarise(tiny, "position_rmse_m", baseline=NONE, notes=("100% of R_k & {x} #1 ~ ^ <$> ± σ",)))  # noqa: RUF001
    assert ("longtable" in text) is (scenarios > 1)
    packages = r"\usepackage[T1]{fontenc}\usepackage{booktabs,longtable,siunitx}"
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
