"""Tables in terminals of several widths: whatever the width, no number and no interval is broken."""

import io
import re
from pathlib import Path

import pytest
from rich.console import Console

from commands import verb
from jerkbench.jobs.study import load_study
from jerkbench.report.summary import summarise
from jerkbench.report.terminal import terminal_table

ROOT = Path(__file__).parents[3]
COLUMNS = {"paper20": ["adaptation"], "drive": ["noise"]}
"""Of studies: short labels, and long ones."""


@pytest.fixture(scope="module", params=COLUMNS)
def table(request):
    rows = load_study(ROOT / "results" / request.param).rows
    return summarise(rows, "position_rmse_m", None, COLUMNS[request.param], baseline={"adaptation": "none"})


def printed(table, width, **options):
    file = io.StringIO()
    Console(file=file, force_terminal=True, width=width, **options).print(terminal_table(table, width))
    return file.getvalue()


@pytest.mark.parametrize("width", [60, 80, 100, 140, 400])
def test_no_interval_is_broken_and_no_line_is_too_long(table, width):
    text = re.sub(r"\x1b\[[0-9;]*m", "", printed(table, width))
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    words = " ".join(text.split())
    for row in table.cells:
        for cell in filter(None, row):
            for part in (cell.number, cell.interval, cell.factor):
                assert part in text
            assert all(word in words for word in cell.trouble.split())
    for values in table.rows:
        heading = ", ".join(f"{key} {value}" for key, value in zip(table.row_keys, values, strict=True))
        assert heading in words or width == 400


def test_without_a_terminal_there_are_no_colours_and_with_no_color_none_either(table, monkeypatch):
    study = str(ROOT / "results" / "paper20")
    assert "\x1b" not in verb("table", study, cwd=ROOT).stdout
    colours = r"\x1b\[(?:[0-9;]*;)?3[0-7][;m]"
    monkeypatch.setenv("NO_COLOR", "1")
    without = printed(table, 100)
    assert not re.search(colours, without)
    monkeypatch.delenv("NO_COLOR")
    if any(cell.trouble for row in table.cells for cell in row if cell):
        assert re.search(colours, printed(table, 100, color_system="standard"))
