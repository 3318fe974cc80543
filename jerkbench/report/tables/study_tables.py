"""Rows of runs -> tables, and the three files that every study leaves: table.md, table.csv, table.tex."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.files import write_atomically, write_text
from jerkbench.report.analysis.rows import metric_columns, with_metric
from jerkbench.report.tables.cell_columns import cell_columns
from jerkbench.report.tables.csv import tidy_csv
from jerkbench.report.tables.grid import arranged
from jerkbench.report.tables.grid_csv import GridCsv
from jerkbench.report.tables.latex import latex
from jerkbench.report.tables.markdown import markdown
from jerkbench.report.tables.summary import beside_others, main_metric, summarise
from jerkbench.report.tables.table_model import Table, TableCell

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Table", "TableCell", "summarise", "write_tables"]

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
    csv, sections = GridCsv(grid), {first: markdown(main, level=1)}

    def write_csv(path: Path) -> None:
        """Write table.csv; sections of table.md are made on the way, while the numbers of their metric are there."""
        with path.open("w", encoding="utf-8", newline="") as file:  # of very many cells a metric at a time is in memory
            file.write(tidy_csv([main]))
            for metric in metric_columns(rows):
                if metric != first:
                    numbers = cell_columns(grid, metric)
                    file.write(csv.lines(metric, numbers))
                    if metric in SECTIONS and len(grid.runs) <= MANY_CELLS and numbers.applies:
                        sections[metric] = markdown(_news(beside_others(numbers, metric), main))

    write_atomically(folder / "table.csv", write_csv)
    ordered = dict.fromkeys([first, *SECTIONS])
    write_text(folder / "table.md", "\n".join(sections[metric] for metric in ordered if metric in sections))
    write_text(folder / "table.tex", latex(main))
    return main


def _news(table: Table, main: Table) -> Table:
    """Return ``table`` without the footnotes that stand under the first one already."""
    return dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in main.footnotes))
