"""Markdown, LaTeX, CSV, JSON and terminal output."""

import csv
import io
import json
import math
import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.parameters import Column
from jerkbench.report import summary
from jerkbench.report.columns import metric_columns, quantity
from jerkbench.report.comparisons import parse_baseline
from jerkbench.report.summary import main_metric, summarise, write_tables
from jerkbench.report.table_model import number
from jerkbench.report.terminal import print_run, print_table
from jerkbench.report.writers import latex, markdown, table_json, tidy_csv, write_rows_csv
from made_rows import cell_rows


def test_numbers_have_three_digits():
    values = [0.014, 0.09996, 9.996, 999.6, 140.2, 4801.3, 0.00035, 2.5e-6, 3.2e9, -0.5, 0.0, float("inf")]
    texts = ["0.0140", "0.100", "10.0", "1000", "140", "4801", "0.000350", "2.50e-06", "3.20e+09", "-0.500", "0", "inf"]
    assert list(map(number, values)) == texts


def test_a_columns_name_says_title_and_unit_and_what_is_the_better_the_higher_is_no_error():
    headings = {
        "position_rmse_m": "Position RMSE (3-D) [m]",
        "velocity_rmse_horizontal_mps": "Velocity RMSE horizontal [m/s]",
        "roll_rmse_rad": "Roll RMSE [rad]",
        "anis_per_row": "ANIS per row, with the reported R",
        "step_us": "Step [µs]",
        "m": "M",
    }
    assert {column: quantity(column).heading for column in headings} == headings
    judged = {"silent_error_percent": True, "rejected_percent": False}
    assert {column: quantity(column).lowest_is_best for column in judged} == judged


@dataclass(frozen=True)
class Found:
    """A metric of somebody else: the higher the better."""

    columns: ClassVar = {
        "found_percent": Column("Found again", judged=False, section=99),
        "lost_per_s": Column("Lost", unit="1/s"),
    }

    def evaluate(self, estimate, recording, counted):
        return {"found_percent": 100.0, "lost_per_s": 0.0}


def test_a_metric_of_somebody_else_says_how_its_columns_are_read(rows, tmp_path, monkeypatch):
    assert quantity("found_percent").lowest_is_best
    monkeypatch.setattr(plugins, "_registry", {**plugins._registry, "metric": {**plugins._registry["metric"]}})
    plugins.register("metric", "found")(Found)

    assert quantity("found_percent").heading == "Found again [%]"
    assert quantity("lost_per_s").heading == "Lost [1/s]"
    assert not quantity("found_percent").lowest_is_best
    write_tables(rows.assign(found_percent=np.linspace(10.0, 90.0, len(rows))), tmp_path)
    section = (tmp_path / "table.md").read_text().partition("## Found again [%]")[2]
    assert section
    assert "**" not in section


def pipes(line):
    return [match.start() for match in re.finditer(r"(?<!\\)\|", line)]


def test_markdown_has_aligned_pipes_bold_and_footnotes(rows):
    lines = markdown(summarise(rows.replace("sage_husa", "a|b"), "position_rmse_m")).splitlines()
    assert lines[0] == "## Position RMSE (3-D) [m]"
    grid = [line for line in lines if line.startswith("|")]
    assert len(grid) == 4
    assert len({tuple(pipes(line)) for line in grid}) == 1
    assert [text.strip() for text in re.split(r"(?<!\\)\|", grid[0])] == ["", "filter", "none", r"a\|b", ""]
    assert re.search(r"\| jerk +\| \*\*0\.0125\*\* \[0\.01\d\d, 0\.01\d\d\] gm 0\.0124 +\| 0\.0225 \[", grid[2])
    assert grid[3].split("|")[3].strip() == "–"  # noqa: RUF001 - the sign itself
    assert "- In every cell: dataset field, disturbance none, attitude tilt, noise default." in lines


def test_latex_is_balanced_and_escaped(rows):
    comment, _, text = latex(summarise(rows, "position_rmse_m", notes=("100% of R_k & {x} #1 ~ ^ <$>",))).partition(
        "\n"
    )
    assert comment == r"% \usepackage{booktabs,siunitx}"
    assert text.count(r"\begin{") == text.count(r"\end{") == 3
    bare = text.replace(r"\{", "").replace(r"\}", "")
    assert bare.count("{") == bare.count("}")
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")]
    lines = [line for line in body.splitlines() if line.endswith(r"\\")]
    assert {line.count("&") for line in lines} == {2}
    assert r"sage\_husa" in lines[0]
    assert r"\bfseries 0.0125 &" in body
    assert r"(4/8 diverged)" in body
    assert not re.search(r"(?<!\\)[_%#$~^]", text.replace(r"$\mu$", ""))
    assert r"100\% of R\_k \& \{x\} \#1 \textasciitilde{} \textasciicircum{} \textless{}\$\textgreater{}" in text


def test_csv_reads_back_with_all_digits(rows):
    table = summarise(rows, "position_rmse_m")
    lines = list(csv.DictReader(io.StringIO(tidy_csv([table, summarise(rows, "anees")]))))
    assert len(lines) == 6
    first, *_ = lines
    cell = table.cells[0][0]
    assert tuple(float(first[name]) for name in ("mean", "low", "high")) == (cell.mean, cell.low, cell.high)
    (one,) = [line for line in lines if line["filter"] == "baseline" and line["metric"] == "position_rmse_m"]
    assert (one["runs"], one["diverged"], one["failed"], one["missing"], one["unit"]) == ("8", "4", "0", "0", "m")
    assert (one["dataset"], one["adaptation"], one["noise"]) == ("field", "none", "default")


def test_the_terminal_shows_brackets_one_cell_and_the_metric_that_is_asked_for(rows, capsys):
    both = pd.concat([rows, rows.assign(disturbance="bias")])
    table = summarise(both, "position_rmse_m", notes=("A note.",))
    print_table(table, "jerkbench table study --notes", every_note=True)
    out = capsys.readouterr().out
    assert re.search(r"\*\*0\.0125\*\* \[0\.01\d\d, 0\.01\d\d\]", out)
    assert "(4/8 diverged)" in out
    assert len(re.findall(r"^ *bias +(?:jerk|baseline) ", out, flags=re.MULTILINE)) == 1
    assert out.splitlines()[-1].rstrip() == "A note."
    print_run(rows[rows["filter"] == "baseline"].assign(outage_rmse_m=float("nan")))
    out = capsys.readouterr().out
    assert "ANEES of position and velocity" in out
    assert "outage" not in out
    assert "seed 4 diverged: The position error is 4000 m at 3.00 s; the limit is 1000 m." in out
    print_table(summarise(rows, "anees"), "jerkbench table study --notes")
    assert capsys.readouterr().out.startswith("ANEES of position and velocity")


def test_the_three_files(rows, tmp_path):
    frame = rows.assign(velocity_rmse_mps=0.1, outage_rmse_m=float("nan"), step_us=3)
    write_tables(frame, tmp_path / "new", ("A note.",))
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["table.csv", "table.md", "table.tex"]
    text = (tmp_path / "new" / "table.md").read_text(encoding="utf-8")
    titles = [line for line in text.splitlines() if line.startswith("#")]
    assert titles == ["# Position RMSE (3-D) [m]", "## Velocity RMSE (3-D) [m/s]", "## ANEES of position and velocity"]
    assert text.count("A note.") == text.count("In every cell") == 1
    metrics = pd.read_csv(tmp_path / "new" / "table.csv")["metric"].unique()
    assert list(metrics) == ["position_rmse_m", "anees", "velocity_rmse_mps", "outage_rmse_m", "step_us"]
    assert r"\caption{Position RMSE (3-D) {[}m{]}}" in (tmp_path / "new" / "table.tex").read_text(encoding="utf-8")


@pytest.fixture
def without_position(rows):
    return rows.drop(columns="position_rmse_m").assign(step_us=3, velocity_rmse_mps=0.25)


def test_without_the_main_metric_the_first_that_was_computed_leads(without_position, tmp_path):
    write_tables(without_position, tmp_path, ("A note.",))
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    titles = [line for line in text.splitlines() if line.startswith("#")]
    assert titles == ["# ANEES of position and velocity", "## Velocity RMSE (3-D) [m/s]"]
    assert text.index("A note.") < text.index("## Velocity")
    metrics = pd.read_csv(tmp_path / "table.csv")["metric"].unique()
    assert list(metrics) == ["anees", "step_us", "velocity_rmse_mps"]
    assert r"\caption{ANEES of position and velocity}" in (tmp_path / "table.tex").read_text(encoding="utf-8")
    assert summarise(without_position, main_metric(without_position)).title == "ANEES of position and velocity"


def test_the_terminal_shows_the_important_notes_and_the_geometric_mean_only_where_it_is_asked_for(rows, capsys):
    failed = rows["filter"] == "baseline"
    rows = rows.assign(status=rows["status"].mask(failed, "failed"), reason="ValueError: no.")
    table = summarise(rows, "position_rmse_m", notes=("First.", "2 damaged files of results are left out: a, b."))
    print_table(table, "jerkbench table study --notes")
    out = capsys.readouterr().out
    assert " gm " not in out
    *_, first, second, last = out.splitlines()
    assert [first.strip(), second.strip()] == ["Failed: ValueError: no.", table.footnotes[-1]]
    assert last.strip() == f"{len(table.footnotes) - 3} more notes: jerkbench table study --notes"
    print_table(table, "jerkbench table study --notes", wide=True, every_note=True)
    out = capsys.readouterr().out
    assert " gm 0.0124" in out
    assert all(note in out for note in table.footnotes)


def test_of_a_long_table_the_terminal_has_the_beginning(cell_rows, capsys):
    frame = pd.DataFrame([row for name in "abcd" for row in cell_rows(name, "none", [1.0, 2.0])])
    print_table(summarise(frame, "position_rmse_m"), "jerkbench table study --notes", max_rows=3)
    out = capsys.readouterr().out

    assert "These are the first 3 of 4 rows; table.md has all." in out
    assert [line.split()[0] for line in out.splitlines() if line.split()[:1] and line.split()[0] in "abcd"] == [*"abc"]


def test_every_kind_of_column_is_written_as_pandas_does_and_no_rows_are_a_header(tmp_path):
    rng = np.random.default_rng(5)
    numbers = np.r_[rng.standard_normal(20) * 10.0 ** rng.integers(-300, 300, 20), np.nan, np.inf, -np.inf, -0.0, 1e22]
    texts = ["plain", 'with "quotes"', "a, b", "two\nlines", "a\rb", "", "é", None, " blanks "]
    rows = pd.DataFrame(
        {
            "numbers": numbers,
            "text": pd.Series([texts[k % len(texts)] for k in range(25)], dtype="str"),
            "anything": [None if k % 3 else k / 7 for k in range(25)],
            "strange, name": np.arange(25) * 10**12,
            "flag": numbers > 0,
            "empty": np.nan,
        }
    )
    write_rows_csv(rows, tmp_path / "rows.csv")
    rows["text"] = rows["text"].str.replace("\r", r"\r")  # what ends a line for some and not for others is written out
    assert (tmp_path / "rows.csv").read_bytes() == rows.to_csv(index=False, lineterminator="\n").encode()
    write_rows_csv(pd.DataFrame({"a": [1.0], "b": ["x"]}).iloc[:0], tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text(encoding="utf-8") == "a,b\n"


def cell_of(content, **factors):
    (cell,) = (cell for cell in content["cells"] if factors.items() <= cell["combination"].items())
    return cell


def test_json_has_all_factors_digits_ratios_and_what_is_lost(rows):
    content = json.loads(table_json(summarise(rows, "position_rmse_m")))
    cell = cell_of(content, filter="jerk", adaptation="none")
    assert set(cell["combination"]) == {"dataset", "disturbance", "attitude", "filter", "adaptation", "noise"}
    values = rows[(rows["filter"] == "jerk") & (rows["adaptation"] == "none")]["position_rmse_m"]
    assert cell["geometric_mean"] == pytest.approx(math.exp(np.log(values).mean()), rel=1e-12)
    assert cell["mean"] == pytest.approx(np.median(values), rel=1e-12)
    assert (content["unit"], cell["runs"], cell["average"]) == ("m", 8, "median")
    assert len(content["cells"]) == 3  # what was not run is not there
    table = summarise(rows, "position_rmse_m", baseline=parse_baseline("adaptation=none"))
    content = json.loads(table_json(table))
    compared = cell_of(content, filter="jerk", adaptation="sage_husa")
    jerk = rows[rows["filter"] == "jerk"].pivot_table(index="seed", columns="adaptation", values="position_rmse_m")
    assert content["baseline"] == {"adaptation": "none"}
    assert compared["ratio"] == pytest.approx(math.exp(np.log(jerk["sage_husa"] / jerk["none"]).mean()), rel=1e-9)
    assert compared["verdict"] == "worse"
    assert cell_of(content, filter="jerk", adaptation="none")["ratio"] is None
    rows.loc[(rows["filter"] == "baseline") & (rows["seed"] > 1), "status"] = "diverged"
    rows.loc[(rows["filter"] == "jerk") & (rows["adaptation"] == "none"), "status"] = "diverged"
    text = table_json(summarise(rows, "position_rmse_m"))
    most, every = (cell_of(json.loads(text), adaptation="none", filter=name) for name in ("baseline", "jerk"))
    assert (most["diverged"], most["average"], most["mean"]) == (6, "median", "lost")
    assert (every["diverged"], every["mean"]) == (8, None)
    assert "NaN" not in text
    assert "Infinity" not in text


LABELS = [
    ("drive,2", 'base"line', "none", "accel=0.1"),
    ("drive,2", "jerk", "mtf", "accel=0.1"),
    ("field", "jerk", "none", "accel=0.2"),
    ("field", 'base"line', "mtf", "accel=0.1"),
    ("field", "jerk", "mtf", "accel=0.1"),
]


def runs_of(count, replicate, seed):
    """Runs of every ending, with metrics that some of them lack, that are negative, zero, huge or the same in all."""
    rng, rows = np.random.default_rng(seed), []
    for dataset, model, rule, noise in LABELS:
        for row in cell_rows(model, rule, rng.lognormal(0, 1.5, count), dataset=dataset, noise=noise):
            anees, drift, speed = rng.lognormal(0, 1.5, 3)
            row |= {"replicate": replicate, "status": rng.choice(["ok", "diverged", "failed"], p=[0.8, 0.1, 0.1])}
            row |= {"anees": anees if rng.random() < 0.7 else np.nan, "drift_mps": drift - 1, "step_us": 3}
            rows.append(row | {"outage_end_m": np.nan, "velocity_rmse_mps": 1e300 * speed})
    return pd.DataFrame(rows)


@pytest.mark.parametrize(("count", "replicate"), [(1, "seed"), (3, "seed"), (6, "seed"), (21, "seed"), (4, "phase")])
def test_each_metric_has_the_lines_of_its_own_table(count, replicate, tmp_path):
    rows = runs_of(count, replicate, seed=count)
    write_tables(rows, tmp_path)

    first = main_metric(rows)
    others = [metric for metric in metric_columns(rows) if metric != first]
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == tidy_csv(
        [summarise(rows, metric, leaders=False) for metric in (first, *others)]
    )


def test_of_very_many_cells_the_markdown_has_the_first_table_alone(tmp_path, monkeypatch):
    rows = runs_of(3, "seed", seed=3)
    write_tables(rows, tmp_path / "few")
    monkeypatch.setattr(summary, "MANY_CELLS", len(LABELS) - 1)
    write_tables(rows, tmp_path / "many")

    few, many = ((tmp_path / name / "table.md").read_text(encoding="utf-8") for name in ("few", "many"))
    assert few.count("\n## ") > 0
    assert many.count("\n## ") == 0
    assert few.startswith(many)
    assert (tmp_path / "few" / "table.csv").read_bytes() == (tmp_path / "many" / "table.csv").read_bytes()
