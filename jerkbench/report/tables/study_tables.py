"""Rows of runs -> tables, and the three files that every study leaves: table.md, table.csv, table.tex."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.files import write_text
from jerkbench.report.analysis.rows import metric_columns
from jerkbench.report.tables.csv import tidy_csv
from jerkbench.report.tables.latex import latex
from jerkbench.report.tables.markdown import markdown
from jerkbench.report.tables.summary import main_metric, summarise, summarise_each
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


def write_tables(rows: "pd.DataFrame", folder: Path, notes: Sequence[str] = ()) -> None:
    """Write table.md, table.csv and table.tex into ``folder``; the last has `main_metric` alone.

    Args:
        rows: as for `summarise`.
        folder: made where it is not there; each file is replaced as a whole.
        notes: sentences that go under the first table.
    """
    first = main_metric(rows)
    main = summarise(rows, first, notes=notes)
    sections, lines = {first: markdown(main, level=1)}, [tidy_csv([main])]
    for table in summarise_each(rows, [metric for metric in metric_columns(rows) if metric != first]):
        lines.append(tidy_csv([table], header=False))
        if table.metric in SECTIONS and _applies(table):
            sections[table.metric] = markdown(_news(table, main))
    ordered = dict.fromkeys([first, *SECTIONS])
    write_text(folder / "table.md", "\n".join(sections[metric] for metric in ordered if metric in sections))
    write_text(folder / "table.csv", "".join(lines))
    write_text(folder / "table.tex", latex(main))


def _news(table: Table, main: Table) -> Table:
    """Return ``table`` without the footnotes that stand under the first one already."""
    return dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in main.footnotes))


def _applies(table: Table) -> bool:
    return any(cell is not None and not math.isnan(cell.mean) for row in table.cells for cell in row)
