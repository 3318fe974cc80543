"""Markdown, LaTeX, CSV and terminal: what is written can be read back."""

import csv
import io
import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.parameters import Column
from jerkbench.report import terminal
from jerkbench.report.columns import quantity
from jerkbench.report.summary import summarise, write_tables
from jerkbench.report.table_model import number
from jerkbench.report.terminal import print_run, print_table
from jerkbench.report.writers import latex, markdown, tidy_csv


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.014, "0.0140"),
        (0.09996, "0.100"),
        (9.996, "10.0"),
        (999.6, "1000"),
        (140.2, "140"),
        (4801.3, "4801"),
        (0.00035, "0.000350"),
        (2.5e-6, "2.50e-06"),
        (3.2e9, "3.20e+09"),
        (-0.5, "-0.500"),
        (0.0, "0"),
        (float("inf"), "inf"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("column", "heading"),
    [
        ("position_rmse_m", "Position RMSE (3-D) [m]"),
        ("velocity_rmse_horizontal_mps", "Velocity RMSE horizontal [m/s]"),
        ("roll_rmse_rad", "Roll RMSE [rad]"),
        ("anis_per_row", "ANIS per row, with the reported R"),
        ("step_us", "Step [µs]"),
        ("m", "M"),
    ],
)
def test_a_columns_name_says_title_and_unit(column, heading):
    assert quantity(column).heading == heading


@pytest.mark.parametrize(
    ("column", "judged"), [("captured_percent", True), ("returned_percent", False), ("rejected_percent", False)]
)
def test_what_is_the_better_the_higher_and_what_an_adaptation_did_is_not_judged_as_an_error(column, judged):
    assert quantity(column).lowest_is_best == judged


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


def test_terminal_shows_brackets_and_says_a_row_header_once(rows, capsys):
    both = pd.concat([rows, rows.assign(disturbance="bias")])
    print_table(both, ("A note.",))
    out = capsys.readouterr().out
    assert re.search(r"\*\*0\.0125\*\* \[0\.01\d\d, 0\.01\d\d\]", out)
    assert "(4/8 diverged)" in out
    assert len(re.findall(r"^ *bias +(?:jerk|baseline) ", out, flags=re.MULTILINE)) == 1
    assert out.splitlines()[-1].rstrip() == "A note."


def test_terminal_shows_one_cell_with_all_metrics_and_reasons(rows, capsys):
    print_run(rows[rows["filter"] == "baseline"].assign(outage_rmse_m=float("nan")))
    out = capsys.readouterr().out
    assert "ANEES of position and velocity" in out
    assert "outage" not in out
    assert "seed 4 diverged: The position error is 4000 m at 3.00 s; the limit is 1000 m." in out


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
    assert r"\caption{Position RMSE (3-D) {[}\unit{m}{]}}" in (tmp_path / "new" / "table.tex").read_text(
        encoding="utf-8"
    )


@pytest.fixture
def without_position(rows):
    return rows.drop(columns="position_rmse_m").assign(step_us=3, velocity_rmse_mps=0.25)


def test_without_the_main_metric_the_first_that_was_computed_leads(without_position, tmp_path, capsys):
    write_tables(without_position, tmp_path, ("A note.",))
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    titles = [line for line in text.splitlines() if line.startswith("#")]
    assert titles == ["# ANEES of position and velocity", "## Velocity RMSE (3-D) [m/s]"]
    assert text.index("A note.") < text.index("## Velocity")
    metrics = pd.read_csv(tmp_path / "table.csv")["metric"].unique()
    assert list(metrics) == ["anees", "step_us", "velocity_rmse_mps"]
    assert r"\caption{ANEES of position and velocity}" in (tmp_path / "table.tex").read_text(encoding="utf-8")
    print_table(without_position)
    assert capsys.readouterr().out.startswith("ANEES of position and velocity")


def test_the_terminal_shows_the_metric_that_is_asked_for(rows, capsys):
    print_table(rows, metric="anees")
    assert capsys.readouterr().out.startswith("ANEES of position and velocity")


def test_the_same_rows_give_the_same_bytes(rows, tmp_path):
    for name in ("a", "b"):
        write_tables(rows, tmp_path / name, ())
    for name in ("table.md", "table.csv", "table.tex"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_of_a_long_table_the_terminal_has_the_beginning(cell_rows, capsys, monkeypatch):
    frame = pd.DataFrame([row for name in "abcd" for row in cell_rows(name, "none", [1.0, 2.0])])
    monkeypatch.setattr(terminal, "MAX_ROWS", 3)
    print_table(frame)
    out = capsys.readouterr().out

    assert "These are the first 3 of 4 rows; table.md has all." in out
    assert [line.split()[0] for line in out.splitlines() if line.split()[:1] and line.split()[0] in "abcd"] == [*"abc"]
