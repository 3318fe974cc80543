"""The shape of what is stored: whether a cell, or a manifest, is one that this package has written."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pyarrow as pa

from jerkbench.cells.labels import Labels
from jerkbench.evaluation.evaluated_run import RUN
from jerkbench.plain import is_plain

KEY = re.compile("[0-9a-f]+")
"""The letters of the name of a cell's file."""

MOST_ROWS = 10_000_000
"""A file that says that it has more is damaged: nobody has run so many seeds."""

Test = Callable[[Any], bool]


def is_key(name: str) -> bool:
    """Whether a file of this name, without its ending, can be a cell's."""
    return KEY.fullmatch(name) is not None


def is_cell(table: pa.Table, metadata: object) -> bool:
    """Whether rows, and what is stored beside them, are those of a cell."""
    return _has(metadata, CELL) and _is_table(table, metadata["labels"], metadata["failed"])  # type: ignore[index]  # it has them


def is_manifest(content: object) -> bool:
    """Whether the content of a manifest is one; parts may be missing."""
    return isinstance(content, Mapping) and all(MANIFEST[name](content[name]) for name in MANIFEST if name in content)


def is_text(value: object) -> bool:
    """Whether it is text that steers no terminal."""
    return isinstance(value, str) and is_plain(value)


def is_texts(value: object) -> bool:
    """Whether it is a list of such texts."""
    return isinstance(value, list) and all(map(is_text, value))


def _count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _mapping_of(test: Test) -> Test:
    return lambda value: (
        isinstance(value, Mapping) and all(is_text(name) and test(entry) for name, entry in value.items())
    )


def _anything(_: object) -> bool:
    return True


def _has(value: object, tests: Mapping[str, Test]) -> bool:
    return isinstance(value, Mapping) and all(name in value and test(value[name]) for name, test in tests.items())


def _named(value: object) -> bool:
    """Whether it is a plugin with its parameters."""
    return _mapping_of(_anything)(value) and _has(value, {"name": is_text})


def _several(value: object) -> bool:
    return isinstance(value, list) and all(map(_named, value))


SPEC: Mapping[str, Test] = {
    **dict.fromkeys(("dataset", "attitude", "filter", "adaptation", "engine"), _named),
    "disturbance": _several,
    "metrics": is_texts,
}
"""The specification of a cell, part by part."""


def _spec(value: object) -> bool:
    return _has(value, SPEC)


def _protocol(value: object) -> bool:
    numbers = dict.fromkeys(("burn_in_s", "divergence_limit_m"), _number)
    return _has(value, dict.fromkeys(("seeds", "first_seed"), _count) | numbers)


def _labels(value: object) -> bool:
    return _mapping_of(is_text)(value) and tuple(value) == Labels._fields  # type: ignore[arg-type]  # it is a mapping


CELL: Mapping[str, Test] = {
    "labels": _labels,
    "spec": _spec,
    "protocol": _protocol,
    "data": is_text,
    "notes": is_texts,
    "code": is_text,
    "versions": _mapping_of(is_text),
    "commit": is_text,
    "created": is_text,
    "seconds": _number,
    "failed": _count,
}
"""The metadata of a cell, stored beside its rows."""

MANIFEST: Mapping[str, Test] = {
    "cells": is_texts,
    "last": is_texts,
    "levels": _mapping_of(_number),
    "notes": _mapping_of(is_texts),
    "tags": _mapping_of(is_texts),
    "command": is_texts,
    "finished": is_text,
    "versions": _mapping_of(is_text),
    "commit": is_text,
    "host": _mapping_of(lambda value: value is None or is_text(value) or _count(value)),
    "configuration": _mapping_of(_mapping_of(_anything)),
}

STATUSES = {"ok", "diverged", "failed"}
REPLICATES = {"seed", "phase"}


def _is_table(table: pa.Table, labels: Mapping[str, str], failed: int) -> bool:
    names = table.column_names
    head = (*labels, *RUN)
    if table.num_rows == 0 or len(set(names)) < len(names) or not set(head) <= set(names):
        return False
    if not all(is_text(name) and is_metric(table[name].type) for name in names if name not in head):
        return False
    same = all(_values(table, name) == {value} for name, value in labels.items())
    words = _values(table, "replicate") <= REPLICATES and _values(table, "status") <= STATUSES
    if not (same and words and all(map(is_text, _values(table, "reason")))):
        return False
    return _are_seeds(table["seed"]) and table["status"].to_pylist().count("failed") == failed


def _values(table: pa.Table, name: str) -> set[object]:
    return set(table[name].to_pylist()) if pa.types.is_string(table[name].type) else {None}


def is_metric(kind: pa.DataType) -> bool:
    """Whether a column of this type can be a metric's."""
    tests = (pa.types.is_floating, pa.types.is_integer, pa.types.is_boolean, pa.types.is_null)
    return any(test(kind) for test in tests)


def _are_seeds(column: pa.ChunkedArray) -> bool:
    if not pa.types.is_integer(column.type) or column.null_count:
        return False
    seeds: Sequence[int] = column.to_pylist()
    return min(seeds) >= 0 and len(set(seeds)) == len(seeds)
