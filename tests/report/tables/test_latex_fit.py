"""LaTeX tables that fit A4, measured with the metrics of Computer Modern that matplotlib brings."""

import re
from functools import cache
from pathlib import Path

import matplotlib as mpl
import pytest
from matplotlib.ft2font import FT2Font

from commands import verb
from jerkbench.report.tables.latex import latex
from jerkbench.report.tables.latex_fit import fitted_latex
from jerkbench.report.tables.summary import summarise
from jerkbench.results.study import load_study

ROOT = Path(__file__).parents[3]
TEXT_PT = 210 / 25.4 * 72.27 - 2 * 25 / 25.4 * 72.27
SIZES = {"footnotesize": 8 * 1.0625, "scriptsize": 7 * 1.138}
"""Computer Modern is wider at small sizes: cmr8 and cmr7 against cmr10."""


@cache
def width_pt(text, size):
    font = FT2Font(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "cmr10.ttf"))
    font.set_size(100, 72)
    font.set_text(text)
    return font.get_width_height()[0] / 64 / 100 * SIZES[size]


def plain(cell):
    size = "scriptsize" if r"\scriptsize" in cell else "footnotesize"
    bare = re.sub(r"\\(scriptsize|bfseries|itshape)|[{}]", "", cell)
    return bare.replace(r"\_", "_").replace(r"$\times$", "x").replace("\\", "").replace("*", "").strip(), size


def lines_of(environment):
    body = environment[environment.index(r"\midrule") :]
    return [line for line in body.splitlines() if "&" in line]


@pytest.fixture(scope="module", params=["paper20", "error_budget"])
def table(request):
    rows = load_study(ROOT / "results" / request.param).rows
    columns = ["adaptation"] if request.param == "paper20" else ["dataset"]
    return summarise(rows, "position_rmse_m", None, columns, baseline={"filter": "baseline"})


def test_every_table_is_narrower_than_the_paper(table):
    text = fitted_latex(table)
    environments = re.findall(r"\\begin\{longtable\}.*?\\end\{longtable\}", text, flags=re.DOTALL)
    assert environments
    for environment in environments:
        rows = [[plain(cell) for cell in line.rstrip("*").rstrip("\\").split(" & ")] for line in lines_of(environment)]
        widths = [max(width_pt(*cell) for cell in column) for column in zip(*rows, strict=True)]
        assert sum(widths) + 6 * len(widths) <= TEXT_PT
        assert len(widths) > 3


def test_every_number_and_interval_is_there_once_and_balanced(table):
    text = fitted_latex(table)
    bare = text.replace(r"{[}", "[").replace(r"{]}", "]")
    assert text.count(r"\begin{") == text.count(r"\end{")
    assert text.replace(r"\{", "").replace(r"\}", "").count("{") == text.replace(r"\{", "").replace(r"\}", "").count(
        "}"
    )
    intervals = [cell.interval for row in table.cells for cell in row if cell and cell.interval]
    assert sum(bare.count(interval) for interval in set(intervals)) == len(intervals)
    assert text.count(r"\caption{") == 1


@pytest.mark.parametrize("write", [latex, fitted_latex])
def test_the_first_line_names_the_packages(table, write):
    first = write(table).splitlines()[0]
    assert first.startswith(r"% \usepackage{booktabs,siunitx")
    assert ("longtable" in first) == (r"\begin{longtable}" in write(table))
    assert ("margin=25mm" in first) == (write is fitted_latex)


def test_only_latex_is_fitted():
    done = verb("table", str(ROOT / "results" / "error_budget"), "--fit", cwd=ROOT)
    assert done.returncode == 2
    assert "--format tex" in done.stderr
