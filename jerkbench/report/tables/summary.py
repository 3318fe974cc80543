"""Rows of runs -> one table, and the three files that every study leaves."""

import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.evaluation.statistics.errors_over_seeds import MEAN
from jerkbench.files import write_atomically, write_text
from jerkbench.report.analysis.columns import (
    FACTORS,
    Combination,
    constants,
    metric_columns,
    quantity,
    with_metric,
)
from jerkbench.report.analysis.standings import MOST_PAIRS, Comparison, family_note, leaders_of
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, is_rival, study_verdicts
from jerkbench.report.tables.footnotes import footnotes, with_bounds
from jerkbench.report.tables.grid import CellColumns, Grid, Values, arranged, cell_columns
from jerkbench.report.tables.table_model import Ratio, Table, TableCell
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
    rows = with_metric(rows, metric)
    grid = arranged(rows, row_keys, column_keys)
    if verdicts is None and (baseline or leaders):
        verdicts = study_verdicts(grid.rows, metric)
    return _table(cell_columns(grid, metric), metric, notes, baseline or {}, verdicts, leaders=leaders)


def summarise_each(
    rows: "pd.DataFrame",
    metrics: Iterable[str],
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
) -> Iterator[Table]:
    """Yield the tables of several metrics: `summarise` of each, with what they share done once."""
    grid = arranged(rows, row_keys, column_keys)
    for metric in metrics:
        yield beside_others(cell_columns(grid, metric), metric)


def beside_others(numbers: CellColumns, metric: str) -> Table:
    """Return the table of a metric for which nobody asked: who leads a row is marked where that takes no minutes."""
    grid = numbers.grid
    judged = study_verdicts(grid.rows, metric, most=FEW_PAIRS) if len(grid.runs) <= FEW_CELLS else None
    return _table(numbers, metric, (), {}, judged, leaders=True)


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def _table(
    numbers: CellColumns,
    metric: str,
    notes: Sequence[str],
    baseline: Mapping[str, str],
    verdicts: StudyVerdicts | None,
    *,
    leaders: bool,
) -> Table:
    grid = numbers.grid
    comparisons = verdicts.against(baseline) if baseline and verdicts is not None else []
    cells = dict(zip(grid.runs, numbers.cells(), strict=True))
    cells = _with_ratios(cells, comparisons, (*grid.across, *grid.down))
    meaning = quantity(metric)
    if leaders and verdicts is not None and verdicts.judged:
        cells = with_leaders(cells, grid, verdicts)
    lines = [[cells.get((*row, *column)) for column in grid.column_values] for row in grid.row_values]
    table = Table(
        title=meaning.heading,
        metric=metric,
        unit=meaning.unit,
        row_keys=grid.across,
        column_keys=grid.down,
        rows=grid.row_values,
        columns=grid.column_values,
        cells=tuple(tuple(line) for line in lines),
        constants=constants(grid.rows, (*grid.across, *grid.down)),
        baseline=tuple(baseline.items()),
        average=Counter(of.kind for of in cells.values()).most_common(1)[0][0] if cells else MEAN,
    )
    table = with_bounds(table, grid.rows)
    return dataclasses.replace(table, footnotes=footnotes(table, grid.rows, notes, family_note(comparisons)))


def _with_ratios(
    cells: dict[Values, TableCell], comparisons: Sequence[Comparison], keys: tuple[str, ...]
) -> dict[Values, TableCell]:
    """Put each comparison into the cell of its subject."""
    compared = dict(cells)
    for comparison in comparisons:
        place = tuple(getattr(comparison.subject, key) for key in keys)
        judgement = comparison.judgement
        ends = judgement.ratio, judgement.low, judgement.high
        ratio = Ratio(*ends, judgement.p, comparison.mark, judgement.median)
        compared[place] = dataclasses.replace(compared[place], ratio=ratio)
    return compared


def with_leaders(cells: dict[Values, TableCell], grid: Grid, verdicts: StudyVerdicts) -> dict[Values, TableCell]:
    """Mark the leaders of each row, whose columns are methods: where anybody was shown to be worse than another.

    A cell that lost runs, or has no value in some, is not marked beside one that did not; without seeds there is no
    test, and nobody leads.
    """
    if not grid.down or {"dataset", "disturbance"} & set(grid.down):  # else scenarios would compete
        return cells
    factors = grid.rows[[*FACTORS]].to_numpy(dtype=str)
    places = {Combination(*map(str, factors[runs[0]])): place for place, runs in grid.runs.items()}
    fields = [field for field in _fields(cells, grid, places) if len(field) > 1]
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


def _fields(
    cells: Mapping[Values, TableCell], grid: Grid, places: Mapping[Combination, Values]
) -> list[list[Combination]]:
    """Return the combinations of each row that compete."""
    fields: dict[Values, list[Combination]] = {}
    for key, place in places.items():
        cell = cells[place]
        eligible = cell.replicate == "seed" and not cell.missing and not math.isnan(cell.mean)
        if eligible and is_rival(key, grid.down):
            fields.setdefault(place[: len(grid.across)], []).append(key)
    return list(fields.values())


# The three files that every study leaves: table.md, table.csv, table.tex.

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
                        table = beside_others(numbers, metric)
                        news = tuple(note for note in table.footnotes if note not in main.footnotes)
                        sections[metric] = markdown(dataclasses.replace(table, footnotes=news))

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
