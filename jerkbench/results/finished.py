"""The runs that a store holds already, found by the keys of their cells alone."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from jerkbench.results.content import codes_of
from jerkbench.results.parts import KEY, RUNS

SEEN = [KEY, RUNS, "seed", "status"]
"""The columns that are looked at."""


@dataclass(frozen=True)
class Finished:
    """Cells that need not run again.

    Attributes:
        done: cells of which every run is there, and none failed.
        whole: cells of which every run is there.
        damaged: names of the files that are not as they were written.
    """

    done: Collection[str]
    whole: Collection[str]
    damaged: list[str]


def finished_runs(tables: Sequence[pa.Table], keys: Sequence[str], damaged: list[str]) -> Finished:
    """Count the runs of each of ``keys``, each seed once."""
    if not tables:
        return Finished(frozenset(), frozenset(), damaged)
    table = pa.concat_tables(tables).unify_dictionaries()
    good = table.filter(pc.not_equal(table["status"].cast(pa.string()), "failed"))
    wanted = set(keys)
    return Finished(_whole(good) & wanted, _whole(table) & wanted, damaged)


def _whole(table: pa.Table) -> set[str]:
    """The cells of which as many runs are there as they have."""
    codes = codes_of(table[KEY])
    runs = np.unique(np.column_stack([codes, table["seed"].to_numpy()]), axis=0)
    names = table[KEY].combine_chunks().dictionary_encode().dictionary.to_pylist()
    expected = np.zeros(len(names), np.int64)
    expected[codes] = table[RUNS].to_numpy()
    counts = np.bincount(runs[:, 0], minlength=len(names))
    return {names[place] for place in np.flatnonzero((counts == expected) & (counts > 0))}
