"""Rows of runs -> one table, and the three files that every study leaves."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.files import write_atomically, write_text
from jerkbench.report.analysis.columns import (
    FACTORS,
    Combination,
    metric_columns,
    with_metric,
)
from jerkbench.report.analysis.standings import MOST_PAIRS, family_note, leaders_of
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, is_rival, study_verdicts
from jerkbench.report.tables.footnotes import footnoted
from jerkbench.report.tables.grid import Grid, Values, arranged
from jerkbench.report.tables.table_model import Ratio, Table, TableCell
from jerkbench.report.tables.writers import csv_lines, latex, markdown, tidy_csv

if TYPE_CHECKING:
    import pandas as pd

MAIN = "position_rmse_m"
"""The metric of a table for which none is asked."""


FEW_PAIRS = 2_000
"""Where there are more pairs of cells in rows, the leaders of a row are marked only in the table that is asked for."""

FEW_CELLS = 2_000
"""Where there are more combinations, nothing is judged but in the table that is asked for: it takes minutes."""

LEADING = (MAIN, "inclination_rmse_deg", "anis_per_row")
"""What leads a study for which it was computed; the second of attitude alone, the third without a reference."""


def summarise(
    rows: "pd.DataFrame",
    metric: str,
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    baseline: Mapping[str, str] | None = None,
    verdicts: StudyVerdicts | None = None,
    *,
    leaders: bool = True,
) -> Table:
    """Return the table of one metric.

    Args:
        rows: one row a cell and seed: the six factors, seed, replicate ("seed" or "phase"), status ("ok", "diverged",
            "failed"), reason, and the metrics.
        metric: which metric's column.
        row_keys: factors of the rows; without them, all that vary and are not columns.
        column_keys: factors of the columns; without them the adaptation.
        notes: sentences to put under the table, such as which combinations were left out and why.
        baseline: values of factors; each cell then has its ratio to the cell that is like it but for these.
        verdicts: of the study in this metric, for the ratios and for who leads a row; without them they are made.
        leaders: whether to mark who leads a row.

    Raises:
        JerkbenchError: no such metric or factor, or two rows of the same combination and seed.
    """
    grid = arranged(with_metric(rows, metric), row_keys, column_keys)
    if verdicts is None and (baseline or leaders):
        verdicts = study_verdicts(grid.rows, metric)
    cells, compared = grid.cells(metric), verdicts.against(baseline) if baseline and verdicts else []
    for one in compared:
        place = tuple(getattr(one.subject, key) for key in (*grid.across, *grid.down))
        judgement = one.judgement
        ratio = Ratio(judgement.ratio, judgement.low, judgement.high, judgement.p, one.mark, judgement.median)
        cells[place] = dataclasses.replace(cells[place], ratio=ratio)
    if leaders and verdicts:
        cells = with_leaders(cells, grid, verdicts)
    table = dataclasses.replace(grid.table(metric, cells), baseline=tuple((baseline or {}).items()))
    return footnoted(table, grid.rows, notes, family_note(compared))


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def with_leaders(cells: dict[Values, TableCell], grid: Grid, verdicts: StudyVerdicts) -> dict[Values, TableCell]:
    """Mark the leaders of each row, whose columns are methods: where anybody was shown to be worse than another.

    A cell that lost runs, or has no value in some, is not marked beside one that did not; without seeds there is no
    test, and nobody leads.
    """
    if not verdicts.judged or not grid.down or {"dataset", "disturbance"} & set(grid.down):  # else scenarios compete
        return cells
    factors = grid.rows[[*FACTORS]].to_numpy(dtype=str)
    places = {Combination(*map(str, factors[runs[0]])): place for place, runs in grid.runs.items()}
    rows: dict[Values, list[Combination]] = {}  # the combinations of each row that compete
    for key, place in places.items():
        cell = cells[place]
        eligible = cell.replicate == "seed" and not cell.missing and not math.isnan(cell.mean)
        if eligible and is_rival(key, grid.down):
            rows.setdefault(place[: len(grid.across)], []).append(key)
    fields = [field for field in rows.values() if len(field) > 1]
    pairs = [list(itertools.combinations(field, 2)) for field in fields]
    if sum(map(len, pairs)) > MOST_PAIRS:
        return cells
    comparisons = iter(verdicts.compare(itertools.chain.from_iterable(pairs)))
    marked = dict(cells)
    for field, pair in zip(fields, pairs, strict=True):
        leaders = [places[key] for key in leaders_of(field, list(itertools.islice(comparisons, len(pair))))]
        whole = [place for place in leaders if cells[place].complete]  # lost no runs
        for place in (whole or leaders) if len(leaders) < len(field) else ():
            marked[place] = dataclasses.replace(marked[place], best=True)
    return marked


# The three files that every study leaves: table.md, table.csv, table.tex.

SECTIONS = (
    *("position_rmse_m", "position_rmse_horizontal_m", "position_rmse_up_m", "position_max_m", "velocity_rmse_mps"),
    *("outage_rmse_m", "outage_rmse_horizontal_m", "outage_rmse_up_m", "outage_end_m", "inclination_rmse_deg"),
    *("inclination_rmse_rad", "inclination_floor_deg", "roll_rmse_rad", "pitch_rmse_rad", "yaw_rmse_rad"),
    *("anees", "anis_per_row"),
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
    sections = {first: markdown(main, level=1)}

    def write_csv(path: Path) -> None:
        """Write table.csv; sections of table.md are made on the way, while the numbers of their metric are there."""
        with path.open("w", encoding="utf-8", newline="") as file:  # of very many cells a metric at a time is in memory
            file.write(tidy_csv([main]))
            for metric in metric_columns(rows):
                if metric != first:
                    cells = grid.cells(metric)
                    file.writelines(csv_lines(grid.table(metric, cells)))
                    if metric in SECTIONS and len(cells) <= MANY_CELLS:
                        sections[metric] = _section(grid, metric, cells, main.footnotes)

    write_atomically(folder / "table.csv", write_csv)
    ordered = (sections.get(metric) for metric in dict.fromkeys([first, *SECTIONS]))
    write_text(folder / "table.md", "\n".join(filter(None, ordered)))
    write_text(folder / "table.tex", latex(main))
    return main


def _section(grid: Grid, metric: str, cells: dict[Values, TableCell], known: Sequence[str]) -> str:
    """Return the table of a metric for which nobody asked; nothing where it has no value.

    Who leads a row is marked where that takes no minutes; footnotes that are ``known`` are left out.
    """
    if all(math.isnan(cell.mean) for cell in cells.values()):
        return ""
    if len(cells) <= FEW_CELLS:
        cells = with_leaders(cells, grid, study_verdicts(grid.rows, metric, most=FEW_PAIRS))
    table = footnoted(grid.table(metric, cells), grid.rows)
    return markdown(dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in known)))
