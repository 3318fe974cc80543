"""A piece of an audit: some settings of one method, run over a block of drives; and where pieces are kept."""

import hashlib
import json
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self
from uuid import uuid4

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.audit.protocol import AuditMethod, audit_job
from jerkbench.campaigns.entrant import knobs_of
from jerkbench.files import write_atomically
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, versions
from jerkbench.jobs.rows import Task, work
from jerkbench.tuning.space import Setting, Space

TOGETHER = 8
"""Settings that go into one call with all drives of a block: those of one drive fill a vector, and share its data."""

ERROR = "position_rmse_m"
"""The metric that counts."""


class Trial(NamedTuple):
    """A setting: the number of the tuning that tried it, its place there (0: the defaults), and its values."""

    tuning: int
    number: int
    setting: Setting


class Piece(NamedTuple):
    """Settings of a method, to run over drives.

    Attributes:
        dataset: preset of the drives.
        method: the method.
        trials: its settings.
        seeds: of the drives, at most as many as a process keeps.
    """

    dataset: str
    method: AuditMethod
    trials: tuple[Trial, ...]
    seeds: range

    @property
    def key(self) -> tuple[str, str, int, int, int]:
        """What its first row is found by."""
        return (*self.method, self.trials[0].tuning, self.trials[0].number, self.seeds[0])


def drive_blocks(seeds: range) -> list[range]:
    """Cut seeds so that a process keeps the drives of a block in memory."""
    return [seeds[begin : begin + KEPT_INPUTS] for begin in range(0, len(seeds), KEPT_INPUTS)]


def run_piece(piece: Piece) -> pd.DataFrame:
    """Run a piece, in a worker.

    Returns:
        A run a row: the columns of `RUN`, status ("ok", "diverged", or "failed: " and why), log_error.
    """
    job, space = method_and_space(piece.dataset, piece.method)
    rows: list[list[dict[str, Any]]] = []
    for begin in range(0, len(piece.trials), TOGETHER):
        jobs = tuple(space.applied(job, trial.setting) for trial in piece.trials[begin : begin + TOGETHER])
        rows += [[] for _ in jobs]
        rest: Task | None = Task(jobs, piece.seeds)
        while rest is not None:
            results, rest = work(rest)
            for own, result in zip(rows[begin:], results, strict=True):
                own.extend(result.rows)
    runs = [(trial, row) for trial, own in zip(piece.trials, rows, strict=True) for row in own]
    error_m = np.array([row.get(ERROR, np.nan) for _, row in runs], dtype=np.float64)
    with np.errstate(divide="ignore"):
        columns = {
            "filter": piece.method.filter,
            "adaptation": piece.method.adaptation,
            "tuning": np.array([trial.tuning for trial, _ in runs], dtype=np.int8),
            "trial": np.array([trial.number for trial, _ in runs], dtype=np.int16),
            "seed": [row["seed"] for _, row in runs],
            "status": [f"failed: {row['reason']}" if row["status"] == "failed" else row["status"] for _, row in runs],
            "log_error": np.log(error_m).astype(np.float32),
        }
    return pd.DataFrame(columns)


@lru_cache(maxsize=1024)
def method_and_space(dataset: str, method: AuditMethod) -> tuple[Job, Space]:
    """Return a method at its defaults, and its knobs."""
    job = audit_job(dataset, method)
    return job, knobs_of(job)


# The pieces that are done, in files.

RUN = ["filter", "adaptation", "tuning", "trial", "seed"]
"""The columns that name a run; those of its first run name a piece, whose first trial are the defaults."""
TEXTS = ("filter", "adaptation", "status")
HELD_S = 10.0
"""Pieces are stored so often: so much is lost with this process."""


@dataclass
class RunLedger:
    """The runs of all pieces, in the files of one folder, which belongs to one protocol and one code.

    Attributes:
        folder: of the files.
    """

    folder: Path
    _held: list[pd.DataFrame] = field(default_factory=list)
    _written: float = field(default_factory=time.monotonic)

    @classmethod
    def of(cls, protocol: str, folder: Path) -> Self:
        """Return the ledger of a protocol's digest, this code and these libraries, below ``folder``."""
        made = [protocol, code_digest("campaigns", "tuning"), json.dumps(versions())]
        return cls(folder / hashlib.sha256("\n".join(made).encode()).hexdigest()[:12])

    def add(self, runs: pd.DataFrame) -> None:
        """Take the runs of a piece."""
        self._held.append(runs)
        if time.monotonic() - self._written > HELD_S:
            self.flush()

    def flush(self) -> None:
        """Store what is held."""
        if self._held:
            write_rows(pd.concat(self._held, ignore_index=True), self.folder / f"{uuid4().hex}.parquet")
        self._held, self._written = [], time.monotonic()

    def runs(self, seeds: range) -> pd.DataFrame:
        """Return what is stored of the drives ``seeds``, each run once."""
        wanted = [("seed", ">=", seeds.start), ("seed", "<", seeds.stop)]
        tables = [pq.read_table(path, filters=wanted) for path in self.folder.glob("*.parquet")]
        runs: pd.DataFrame = pa.concat_tables(tables).unify_dictionaries().to_pandas()
        for name in TEXTS:  # in which order they were stored shall show nowhere
            runs[name] = runs[name].cat.reorder_categories(sorted(runs[name].cat.categories))
        return runs.drop_duplicates(RUN, ignore_index=True)

    def keys(self, firsts: Collection[int]) -> set[tuple[object, ...]]:
        """Return the keys of the pieces that are stored; ``firsts`` are the first seeds of their blocks."""
        wanted = [("seed", "in", firsts), ("trial", "==", 0)]
        tables = [pq.read_table(path, columns=RUN, filters=wanted) for path in self.folder.glob("*.parquet")]
        return {key for table in tables for key in zip(*table.to_pydict().values(), strict=True)}


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as Parquet: each text as a code, the bytes of numbers apart, which compresses."""
    coded = rows.astype({name: "category" for name in TEXTS if name in rows})
    table = pa.Table.from_pandas(coded, preserve_index=False)
    floats = [known.name for known in table.schema if pa.types.is_floating(known.type)]
    how = {
        "compression": "zstd",
        "use_dictionary": [name for name in table.column_names if name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    }
    write_atomically(path, lambda partial: pq.write_table(table, partial, **how))
