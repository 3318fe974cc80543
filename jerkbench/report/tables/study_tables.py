"""Rows of runs -> tables, and the three files that every study leaves: table.md, table.csv, table.tex."""

import dataclasses
from collections.abc import Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.files import write_atomically, write_text
from jerkbench.report.analysis.columns import constants, metric_columns, quantity, with_metric
from jerkbench.report.tables.grid import CellColumns, Grid, arranged, cell_columns
from jerkbench.report.tables.summary import beside_others, main_metric, summarise
from jerkbench.report.tables.table_model import Table
from jerkbench.report.tables.writers import (
    NO_RATIO,
    csv_head,
    csv_labels,
    csv_line,
    csv_number,
    csv_share,
    latex,
    markdown,
    tidy_csv,
)

if TYPE_CHECKING:
    import pandas as pd

SECTIONS = (
    "position_rmse_m",
    "position_rmse_horizontal_m",
    "position_rmse_up_m",
    "position_max_m",
    "velocity_rmse_mps",
    "outage_rmse_m",
    "outage_rmse_horizontal_m",
    "outage_rmse_up_m",
    "outage_end_m",
    "inclination_rmse_deg",
    "inclination_rmse_rad",
    "inclination_floor_deg",
    "roll_rmse_rad",
    "pitch_rmse_rad",
    "yaw_rmse_rad",
    "anees",
    "anis_per_row",
)
"""Metrics that get a section in table.md, where they apply, after the main one; table.csv has all."""


MANY_CELLS = 20_000
"""Of more combinations table.md has the first table alone; a reader of the others takes table.csv."""


def write_tables(rows: "pd.DataFrame", folder: Path, notes: Sequence[str] = ()) -> Table:
    """Write table.md, table.csv and table.tex into ``folder``; returns the table of `main_metric`, all of the last.

    Args:
        rows: as for `summarise`.
        folder: made where it is not there; each file is replaced as a whole.
        notes: sentences that go under the first table.
    """
    first = main_metric(rows)
    main = summarise(rows, first, notes=notes)
    grid = arranged(with_metric(rows, first), None, None)
    fixed, sections = _fixed_columns(grid), {first: markdown(main, level=1)}

    def write_csv(path: Path) -> None:
        """Write table.csv; sections of table.md are made on the way, while the numbers of their metric are there."""
        with path.open("w", encoding="utf-8", newline="") as file:  # of very many cells a metric at a time is in memory
            file.write(tidy_csv([main]))
            for metric in metric_columns(rows):
                if metric != first:
                    numbers = cell_columns(grid, metric)
                    file.writelines(_csv_lines(numbers, metric, fixed))
                    if metric in SECTIONS and len(grid.runs) <= MANY_CELLS and numbers.applies:
                        sections[metric] = markdown(_news(beside_others(numbers, metric), main))

    write_atomically(folder / "table.csv", write_csv)
    ordered = dict.fromkeys([first, *SECTIONS])
    write_text(folder / "table.md", "\n".join(sections[metric] for metric in ordered if metric in sections))
    write_text(folder / "table.tex", latex(main))
    return main


def _fixed_columns(grid: Grid) -> tuple[IntArray, tuple[list[str], ...]]:
    """Return the order of the cells in the table, and those of their columns of CSV that each metric has alike."""
    place = {key: number for number, key in enumerate(grid.runs)}
    keys = ((*row, *column) for row in grid.row_values for column in grid.column_values)
    order = np.array([place[key] for key in keys if key in place], dtype=np.int64)
    names, runs = (*grid.across, *grid.down), list(grid.runs)
    same = dict(constants(grid.rows, names))
    labels = [csv_labels(same | dict(zip(names, runs[k], strict=True))) for k in order.tolist()]
    counts = np.column_stack([grid.sizes, grid.diverged, grid.failed])[order].tolist()
    shares = [csv_share(diverged + failed, size) for size, diverged, failed in counts]
    words = np.where(grid.phases[order], "phase", "seed").tolist()
    return order, (labels, [",".join(map(str, of)) for of in counts], words, shares)


def _csv_lines(numbers: CellColumns, metric: str, fixed: tuple[IntArray, tuple[list[str], ...]]) -> Iterator[str]:
    """Yield the lines that `tidy_csv` would write for a metric, without an object for each cell."""
    of, (order, (labels, counts, words, shares)) = numbers.centres, fixed
    floats = (of.value, of.low, of.high, of.lower_quartile, of.upper_quartile, of.geometric)
    mean, low, high, lower, upper, geometric = (map(csv_number, values[order].tolist()) for values in floats)
    missing, locked = (map(str, values[order].tolist()) for values in (numbers.missing, of.locked))
    beginning = (repeat(csv_head(metric, quantity(metric).unit)), labels, of.kind[order].tolist(), mean, low, high)
    end = (counts, missing, words, repeat(NO_RATIO), lower, upper, locked, shares, geometric)
    return map(csv_line, zip(*beginning, *end, strict=False))


def _news(table: Table, main: Table) -> Table:
    """Return ``table`` without the footnotes that stand under the first one already."""
    return dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in main.footnotes))
