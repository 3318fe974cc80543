"""From rows to cells: grouping, means, intervals, the best, failures and bounds."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest, gmean

from jerkbench.errors import JerkbenchError
from jerkbench.report.summary import summarise
from roots import mean_ends


def cell_of(table, row, column):
    return table.cells[table.rows.index(row)][table.columns.index(column)]


def test_columns_are_adaptations_rows_what_else_varies_and_both_can_be_chosen(rows):
    table = summarise(rows, "position_rmse_m")
    assert (table.row_keys, table.column_keys) == (("filter",), ("adaptation",))
    assert table.rows == (("jerk",), ("baseline",))  # order of appearance, not of the alphabet
    assert table.columns == (("none",), ("sage_husa",))
    assert dict(table.constants) == {"dataset": "field", "disturbance": "none", "attitude": "tilt", "noise": "default"}
    assert "In every cell: dataset field, disturbance none, attitude tilt, noise default." in table.footnotes
    table = summarise(rows, "position_rmse_m", notes=("sage_husa was left out for the baseline.",))
    assert cell_of(table, ("baseline",), ("sage_husa",)) is None
    assert "–: this combination was not run." in table.footnotes  # noqa: RUF001 - the sign itself
    assert table.footnotes[-1] == "sage_husa was left out for the baseline."
    table = summarise(rows, "position_rmse_m", row_keys=["adaptation"])
    assert (table.row_keys, table.column_keys) == (("adaptation",), ("filter",))
    table = summarise(rows, "position_rmse_m", row_keys=["dataset"], column_keys=["filter", "adaptation"])
    assert table.header == ["dataset", "jerk / none", "jerk / sage_husa", "baseline / none"]
    assert cell_of(table, ("field",), ("jerk", "sage_husa")).mean == pytest.approx(0.0225)
    both = pd.concat([rows, rows.assign(disturbance="bias", position_rmse_m=rows["position_rmse_m"] * 10)])
    table = summarise(both, "position_rmse_m", row_keys=["filter"])
    assert table.row_keys == ("filter", "disturbance")
    assert cell_of(table, ("jerk", "bias"), ("none",)).mean == pytest.approx(0.125)


def test_a_cell_is_the_geometric_mean_of_few_seeds_and_from_six_on_the_median(rows):
    few = summarise(rows[rows["seed"] < 5], "position_rmse_m")
    good = cell_of(few, ("jerk",), ("none",))
    logs = np.log([0.011, 0.012, 0.014, 0.013, 0.011])
    assert (good.mean, good.low, good.high) == pytest.approx(tuple(np.exp([logs.mean(), *mean_ends(logs)])))
    assert (good.runs, good.diverged, good.failed, good.geometric_text) == (5, 0, 0, "")
    assert cell_of(few, ("baseline",), ("none",)).text.endswith("(1/5 diverged)")
    table = summarise(rows, "position_rmse_m")
    good = cell_of(table, ("jerk",), ("none",))
    assert (good.mean, good.geometric) == pytest.approx((0.0125, gmean([0.011, 0.012, 0.013, 0.014])))
    assert good.text == "**0.0125** [0.0110, 0.0140] gm 0.0124".replace("**", "")
    assert (good.runs, good.diverged, good.failed) == (8, 0, 0)


@pytest.mark.parametrize("count", [1, 2, 5, 6, 20])
@pytest.mark.parametrize("replicate", ["seed", "phase"])
def test_the_name_of_a_cells_value_does_not_depend_on_a_failure(cell_rows, count, replicate):
    values = np.exp(0.1 * np.random.default_rng(1).standard_normal(count))
    whole = pd.DataFrame(cell_rows("jerk", "none", values, replicate=replicate))
    lost, locked, zero = whole.copy(), whole.copy(), whole.copy()
    lost.loc[0, "status"] = "diverged"
    locked.loc[0, "position_rmse_m"] = 60.0
    zero.loc[0, "position_rmse_m"] = 0.0
    kinds = {summarise(frame, "position_rmse_m").cells[0][0].kind for frame in (whole, lost, locked, zero)}
    assert kinds == {"median" if count >= 6 and replicate == "seed" else "geometric mean"}


def test_lost_runs_leave_the_median_of_all(rows, cell_rows):
    """Nobody's mean is over the survivors: of 4 lost of 8 runs the median is lost, of 2 of 7 it is the fourth."""
    half = cell_of(summarise(rows, "position_rmse_m"), ("baseline",), ("none",))
    assert half.text == "failed [0.0310, failed] gm 0.0310 (4/8 diverged)"
    frame = pd.DataFrame(cell_rows("jerk", "none", [5.0, 1.0, 2.0, 3.0, 4.0, 9.0, 9.0]))
    frame.loc[frame["position_rmse_m"] == 9.0, "status"] = "diverged"
    table = summarise(frame, "position_rmse_m")
    cell = table.cells[0][0]
    assert (cell.mean, cell.quartiles) == (4.0, (2.5, math.inf))
    assert cell.text.startswith("4.00 [1.")
    assert cell.text.endswith(", failed] gm 2.61 (2/7 diverged)")
    low, high = binomtest(2, 7).proportion_ci(0.95, method="exact")
    share = f"Diverged or failed runs, 95 % interval (Clopper and Pearson): 2/7 {100 * low:.0f} to {100 * high:.0f} %."
    assert share in table.footnotes


def test_rows_of_one_scenario_stand_together_whatever_was_run_first(cell_rows):
    order = [("bias", "jerk"), ("none", "jerk"), ("bias", "baseline"), ("none", "baseline")]
    cells = [{**row, "disturbance": name} for name, model in order for row in cell_rows(model, "none", [1.0, 1.2])]
    table = summarise(pd.DataFrame(cells), "position_rmse_m", row_keys=["disturbance", "filter"])
    assert table.rows == (("bias", "jerk"), ("bias", "baseline"), ("none", "jerk"), ("none", "baseline"))
    assert [row[0].runs for row in table.cells] == [2] * 4


def scattered(mean, scatter, seed, n=20):
    return list(mean * np.exp(scatter * np.random.default_rng(seed).standard_normal(n)))


def best(cell_rows, levels, scatter=0.05, lost=(), **keys):
    """Which of some combinations are best, each with its mean error."""
    cells = [cell_rows(*name, scattered(level, scatter, k)) for k, (name, level) in enumerate(levels.items())]
    for k in lost:
        cells[k][3]["status"] = "diverged"
    table = summarise(pd.DataFrame([row for cell in cells for row in cell]), "position_rmse_m", **keys)
    return [cell.best for cell in table.cells[0]], table.footnotes


def test_the_whole_leading_group_of_a_row_is_best_but_for_what_lost_runs(cell_rows):
    """The two that differ by less than their scatter lead together; the third was shown to be worse."""
    levels = {("jerk", "a"): 1.001, ("jerk", "b"): 1.0, ("jerk", "c"): 1.3}
    found, said = best(cell_rows, levels)
    assert found == [True, True, False]
    assert (
        "Bold: best in the row. No other method is significantly better, and at least one is significantly worse."
        in said
    )
    assert best(cell_rows, levels, lost=[0])[0] == [False, True, False]


@pytest.mark.parametrize("reference", [("jerk", "oracle"), ("jerk", "oracle(x=1)"), ("gnss_only", "none")])
def test_references_never_lead(cell_rows, reference):
    levels = {reference: 0.1, ("jerk", "none"): 1.0, ("jerk", "a"): 2.0}
    found, _ = best(cell_rows, levels, row_keys=["dataset"], column_keys=["filter", "adaptation"])
    assert found == [False, True, False]


def test_the_references_own_attitude_and_scenarios_in_columns_never_lead(cell_rows):
    cells = {"tilt": 2.0, "gyro_only": 3.0, "reference": 1.0}
    made = [
        cell_rows("jerk", "none", scattered(value, 0.05, k), attitude=name)
        for k, (name, value) in enumerate(cells.items())
    ]
    rows = pd.DataFrame([row for cell in made for row in cell])
    table = summarise(rows, "position_rmse_m", column_keys=["attitude"])
    assert [cell.best for cell in table.cells[0]] == [True, False, False]
    easy = pd.DataFrame(cell_rows("jerk", "none", scattered(1.0, 0.05, 1)))
    hard = pd.DataFrame(cell_rows("jerk", "none", scattered(9.0, 0.05, 2))).assign(disturbance="bias")
    table = summarise(pd.concat([easy, hard]), "position_rmse_m", column_keys=["disturbance"])
    assert not any(cell.best for cell in table.cells[0])
    assert not any(best(cell_rows, {("jerk", "a"): 1.0, ("jerk", "b"): 1.01}, scatter=0.3)[0])
    few = pd.DataFrame([*cell_rows("jerk", "a", [1.0, 1.1]), *cell_rows("jerk", "b", [9.0, 9.1])])
    assert not any(cell.best for cell in summarise(few, "position_rmse_m").cells[0])


def test_nothing_is_best_alone_or_in_a_consistency_and_a_metric_may_not_apply(rows):
    baseline = rows[(rows["filter"] == "jerk") & (rows["adaptation"] == "none")]
    assert not summarise(baseline, "position_rmse_m").cells[0][0].best
    assert not any(cell.best for row in summarise(rows, "anees").cells for cell in row if cell)
    assert (
        "A consistent filter gives 6; more is overconfident, less too cautious." in summarise(rows, "anees").footnotes
    )
    table = summarise(rows.assign(outage_rmse_m=np.nan), "outage_rmse_m")
    assert table.cells[0][0].text == "n/a"
    assert not any(note.startswith("k/n n/a") for note in table.footnotes)
    assert math.isnan(table.cells[0][0].mean)
    assert "n/a: the metric does not apply." in table.footnotes


def test_phases_have_a_range_and_no_confidence_interval(cell_rows):
    phases = pd.DataFrame(cell_rows("jerk", "none", [0.0344, 0.0379, 0.0360, 0.0361], replicate="phase"))
    table = summarise(phases, "position_rmse_m")
    assert table.cells[0][0].text == "0.0361 {0.0344–0.0379}"  # noqa: RUF001 - a range
    said = " ".join(table.footnotes)
    assert "range over the phases of one recording, not a confidence interval" in said
    assert "BCa" not in said


def test_runs_without_the_metric_are_counted(cell_rows):
    frame = pd.DataFrame(
        [*cell_rows("jerk", "a", [1.0, 1.1, np.nan, np.nan, np.nan]), *cell_rows("jerk", "b", [3.0] * 5)]
    )
    table = summarise(frame, "position_rmse_m")
    holed, whole = table.cells[0]
    assert holed.text.startswith("1.05 [")
    assert holed.text.endswith("(3/5 n/a)")
    assert (holed.used, holed.missing, holed.complete, holed.best) == (2, 3, False, False)
    assert (whole.used, whole.missing, whole.complete, whole.text) == (5, 0, True, "3.00 [3.00, 3.00]")
    said = " ".join(table.footnotes)
    assert "95 % interval (Student's t of the logarithms, 2 to 5 seeds)" in said
    assert "k/n n/a: k of n runs have no value of this metric. The average is over the other runs." in said
    assert "n/a: the metric does not apply." not in table.footnotes


@pytest.mark.parametrize(
    ("statuses", "values", "text"),
    [
        (["ok", "ok", "ok", "diverged"], [2.0, np.nan, np.nan, 9.0], "2.00 (1/4 diverged, 2/4 n/a)"),
        (["ok", "ok", "diverged", "failed"], [np.nan, np.nan, 9.0, np.nan], "n/a (1/4 diverged, 1/4 failed)"),
        (["diverged", "diverged", "failed", "failed"], [np.nan] * 4, "diverged 2/4, failed 2/4"),
        (["ok"] * 4, [np.nan] * 4, "n/a"),
        (["diverged"] * 4, [2.0] * 4, "diverged 4/4"),
        (["failed"] * 4, [2.0] * 4, "failed 4/4"),
    ],
)
@pytest.mark.parametrize("replicate", ["seed", "phase"])
def test_only_runs_that_went_well_are_missing(cell_rows, statuses, values, text, replicate):
    frame = pd.DataFrame(cell_rows("jerk", "none", values, replicate=replicate)).assign(status=statuses)
    told = summarise(frame, "position_rmse_m").cells[0][0].text
    assert told == text


def test_wrong_names_and_rows_that_repeat_a_seed_are_sentences(rows):
    with pytest.raises(JerkbenchError, match="mean 'position_rmse_m'"):
        summarise(rows, "position_rmse")
    with pytest.raises(JerkbenchError, match=r"no factor 'filtr'. Did you mean 'filter'\?"):
        summarise(rows, "position_rmse_m", row_keys=["filtr"])
    with pytest.raises(JerkbenchError, match="'filter' is given twice"):
        summarise(rows, "position_rmse_m", row_keys=["filter"], column_keys=["filter"])
    with pytest.raises(JerkbenchError, match="24 rows"):
        summarise(pd.concat([rows, rows]), "position_rmse_m")


def test_beside_a_ratio_the_means_are_its_own_and_those_of_a_consistency_arithmetic(cell_rows):
    """The quotient of two numbers is the ratio beside them."""
    none, mtf = [0.1, 0.4, 0.8], [0.2, 0.5, 0.8]
    frame = pd.DataFrame([*cell_rows("jerk", "none", none), *cell_rows("jerk", "mtf", mtf)])
    first, second = summarise(frame, "position_rmse_m", baseline={"adaptation": "none"}).cells[0]
    assert (first.mean, second.mean) == pytest.approx((np.prod(none) ** (1 / 3), np.prod(mtf) ** (1 / 3)))
    assert second.ratio.judgement.ratio == pytest.approx(second.mean / first.mean)
    zero = frame.assign(position_rmse_m=frame["position_rmse_m"].where(frame["seed"] > 0, 0.0))
    table = summarise(zero, "position_rmse_m", baseline={"adaptation": "none"})
    assert (table.cells[0][0].mean, table.cells[0][0].kind) == (0.0, "geometric mean")
    frame = pd.DataFrame([*cell_rows("jerk", "none", [1.0] * 3), *cell_rows("jerk", "mtf", [1.0] * 3)])
    table = summarise(frame.assign(anees=[2.0, 6.0, 10.0] * 2), "anees", baseline={"adaptation": "none"})
    assert [cell.mean for cell in table.cells[0]] == [6.0, 6.0]
