"""The shape of a part of the store: whether a table is one that this package has written."""

import json
from collections.abc import Iterable, Mapping

import pyarrow as pa
import pyarrow.compute as pc

from jerkbench.cells.labels import Labels
from jerkbench.evaluation.evaluated_run import RUN
from jerkbench.results.shape import CELL as METADATA
from jerkbench.results.shape import MOST_ROWS, REPLICATES, STATUSES, Test, is_key, is_metric, is_text, is_texts
from jerkbench.results.shape import SPEC as PLUGINS

CELL = "cell."
"""Beginning of the columns that say something of the whole cell."""

KEY, RUNS, COLUMNS = "cell.key", "cell.runs", "cell.columns"
PROCESSOR = "cell.processor"
"""The kind of processor that ran the cell."""

HEAD = (*Labels._fields, *RUN)
"""The columns that every row has, before its metrics."""

FACTS: Mapping[str, Test] = {
    **{CELL + name: test for name, test in METADATA.items() if name not in ("labels", "spec", "failed")},
    **{f"{CELL}spec.{part}": test for part, test in PLUGINS.items()},
    COLUMNS: is_texts,
}
"""What is stored of each cell, as JSON, with a test of its value."""


OPTIONAL: Mapping[str, Test] = {
    f"{CELL}identity": is_text,
    PROCESSOR: is_text,
    f"{CELL}spec.r_scale": lambda value: isinstance(value, Mapping) and all(map(is_text, value)),
}
"""What some cells have besides."""


def is_part(table: pa.Table) -> bool:
    """Whether a table holds rows of cells, with all that is known of these."""
    names = table.column_names
    if not 0 < table.num_rows <= MOST_ROWS or len(set(names)) < len(names):
        return False
    if not {*HEAD, *FACTS, KEY, RUNS} <= set(names) or not all(map(is_text, names)):
        return False
    return _are_rows(table) and _are_cells(table)


def _are_rows(table: pa.Table) -> bool:
    metrics = (name for name in table.column_names if name not in HEAD and not name.startswith(CELL))
    if not all(is_metric(table[name].type) for name in metrics):
        return False
    words = _texts(table, "replicate") <= REPLICATES and _texts(table, "status") <= STATUSES
    return (
        words
        and all(map(is_text, _every(table, (*Labels._fields, "reason"))))
        and _counts(table["seed"], pa.int64(), 0)
    )


def _are_cells(table: pa.Table) -> bool:
    if not all(_is_coded(table[name].type) for name in table.column_names if name.startswith(CELL) and name != RUNS):
        return False
    keys = _texts(table, KEY)
    tests = [*FACTS.items(), *((name, test) for name, test in OPTIONAL.items() if name in table.column_names)]
    known = all(_is_fact(text, test, name in OPTIONAL) for name, test in tests for text in _texts(table, name))
    return known and all(isinstance(key, str) and is_key(key) for key in keys) and _counts(table[RUNS], pa.int32(), 1)


def _is_fact(text: object, test: Test, may_be_missing: bool) -> bool:
    return test(json.loads(text)) if isinstance(text, str) else may_be_missing


def _every(table: pa.Table, names: Iterable[str]) -> Iterable[object]:
    return (value for name in names for value in _texts(table, name))


def _texts(table: pa.Table, name: str) -> set[object]:
    """The distinct texts of a column; None among them where one is missing, or is no text."""
    return set(pc.unique(table[name]).to_pylist()) if _is_coded(table[name].type) else {None}


def _is_coded(kind: pa.DataType) -> bool:
    """Whether it is that of texts, each of which is kept once."""
    return bool(kind == pa.dictionary(pa.int32(), pa.string()))


def _counts(column: pa.ChunkedArray, kind: pa.DataType, least: int) -> bool:
    """Whether a column holds whole numbers of that type that are at least ``least``."""
    return bool(column.type == kind and not column.null_count and pc.min(column).as_py() >= least)
