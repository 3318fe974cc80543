"""A piece of an audit: some settings of one method, run over a block of drives; and where pieces are kept."""

import json
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self
from uuid import uuid4

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.audit.protocol import AuditMethod, job_of
from jerkbench.campaigns.entrant import knobs_of
from jerkbench.files import write_atomically
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
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


def blocks(seeds: range) -> list[range]:
    """Cut seeds so that a process keeps the drives of a block in memory."""
    return [seeds[begin : begin + KEPT_INPUTS] for begin in range(0, len(seeds), KEPT_INPUTS)]


class Ran(NamedTuple):
    """What came of a piece.

    Attributes:
        error_m: (S, D) position RMSE of each setting on each drive; NaN: there is none.
        status: (S, D) "ok", "diverged", or "failed: " and why.
        cpu_s: time that a run took, mean.
    """

    error_m: np.ndarray[Any, np.dtype[np.float64]]
    status: np.ndarray[Any, np.dtype[np.object_]]
    cpu_s: float


def run_piece(piece: Piece) -> Ran:
    """Run a piece, in a worker."""
    job, space = method_of(piece.dataset, piece.method)
    began = time.process_time()
    rows: list[list[dict[str, Any]]] = []
    for begin in range(0, len(piece.trials), TOGETHER):
        jobs = tuple(space.applied(job, trial.setting) for trial in piece.trials[begin : begin + TOGETHER])
        rows += [[] for _ in jobs]
        rest: Task | None = Task(jobs, piece.seeds)
        while rest is not None:
            results, rest = work(rest)
            for own, result in zip(rows[begin:], results, strict=True):
                own.extend(result.rows)
    status = [[f"failed: {row['reason']}" if row["status"] == "failed" else row["status"] for row in o] for o in rows]
    cpu_s = (time.process_time() - began) / (len(piece.trials) * len(piece.seeds))
    error_m = np.array([[row.get(ERROR, np.nan) for row in own] for own in rows], dtype=np.float64)
    return Ran(error_m, np.array(status, dtype=object), cpu_s)


@lru_cache(maxsize=1024)
def method_of(dataset: str, method: AuditMethod) -> tuple[Job, Space]:
    """Return a method at its defaults, and its knobs."""
    job = job_of(dataset, method)
    return job, knobs_of(job)


# The pieces that are done, in files.

KEY = ["filter", "adaptation", "tuning", "trial", "seed"]
"""The columns of a run's place; those of its first run are the key of a piece, whose first trial are the defaults."""
TEXTS = ("filter", "adaptation", "status")
HELD_S = 10.0
"""Pieces are stored so often: so much is lost with this process."""


@dataclass
class Ledger:
    """The rows of all pieces in the files of one folder, as far as they belong to this protocol and this code.

    Attributes:
        folder: of the files.
        protocol: digest of the protocol.
        any_code: whether rows that other code computed count too.
    """

    folder: Path
    protocol: str
    any_code: bool = False
    _held: list[pd.DataFrame] = field(default_factory=list)
    _written: float = field(default_factory=time.monotonic)

    def __enter__(self) -> Self:
        """Begin to take pieces."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Store what is held, whatever has ended it."""
        self._flush()

    def add(self, piece: Piece, ran: Ran) -> None:
        """Take what came of a piece."""
        S, D = ran.error_m.shape
        with np.errstate(divide="ignore"):
            log_error = np.log(ran.error_m).ravel().astype(np.float32)
        self._held.append(
            pd.DataFrame(
                {
                    "filter": piece.method.filter,
                    "adaptation": piece.method.adaptation,
                    "tuning": np.repeat([trial.tuning for trial in piece.trials], D).astype(np.int8),
                    "trial": np.repeat([trial.number for trial in piece.trials], D).astype(np.int16),
                    "seed": np.tile(np.array(piece.seeds), S),
                    "status": ran.status.ravel(),
                    "log_error": log_error,
                    "cpu_s": np.float32(ran.cpu_s),
                }
            )
        )
        if time.monotonic() - self._written > HELD_S:
            self._flush()

    def _flush(self) -> None:
        if self._held:
            table = compact(pd.concat(self._held, ignore_index=True)).replace_schema_metadata(self._maker())
            write_atomically(self.folder / f"{uuid4().hex}.parquet", lambda path: write_compact(table, path))
        self._held, self._written = [], time.monotonic()

    def rows(self, seeds: range | None = None) -> pd.DataFrame:
        """Return what is stored of the drives ``seeds`` (default: all), each run once."""
        wanted = [] if seeds is None else [("seed", ">=", seeds.start), ("seed", "<", seeds.stop)]
        tables = [pq.read_table(path, filters=wanted or None) for path in self._files()]
        if not tables:
            return pd.DataFrame(columns=[*KEY, "status", "log_error"])
        rows: pd.DataFrame = pa.concat_tables(tables, promote_options="default").unify_dictionaries().to_pandas()
        return rows.drop_duplicates(KEY, ignore_index=True)

    def keys(self, firsts: Collection[int]) -> set[tuple[object, ...]]:
        """Return the keys of the pieces that are stored; ``firsts`` are the first seeds of their blocks."""
        wanted = [("seed", "in", firsts), ("trial", "==", 0)]
        tables = [pq.read_table(path, columns=KEY, filters=wanted) for path in self._files()]
        return {key for table in tables for key in zip(*table.to_pydict().values(), strict=True)}

    def makers(self) -> list[dict[str, str]]:
        """Return the code and the commits that computed what is stored, each once."""
        made = [pq.read_schema(path).metadata for path in self._files()]
        texts = {json.dumps({name: own[name.encode()].decode() for name in self._maker()}) for own in made}
        return [json.loads(text) for text in sorted(texts)]

    def _files(self) -> Sequence[Path]:
        """The files of this protocol and, unless any will do, of this code and these libraries."""
        same = {"protocol": self.protocol}
        if not self.any_code:
            same |= {"code": code_digest(), "versions": json.dumps(versions())}
        return [
            path
            for path in sorted(self.folder.glob("*.parquet"))
            if (made := pq.read_schema(path).metadata)
            and all(made.get(name.encode()) == value.encode() for name, value in same.items())
        ]

    def _maker(self) -> dict[str, str]:
        own = {"code": code_digest(), "commit": git_commit(), "versions": json.dumps(versions())}
        return {"protocol": self.protocol, **own}


def compact(rows: pd.DataFrame) -> pa.Table:
    """Return rows as a table in which each text is a code."""
    return pa.Table.from_pandas(rows.astype({name: "category" for name in TEXTS if name in rows}), preserve_index=False)


def write_compact(table: pa.Table, path: Path) -> None:
    """Write a table of rows: codes as they are, the bytes of numbers apart, which compresses."""
    floats = [known.name for known in table.schema if pa.types.is_floating(known.type)]
    texts = [known.name for known in table.schema if known.name not in floats]
    encoding = dict.fromkeys(floats, "BYTE_STREAM_SPLIT")
    pq.write_table(table, path, compression="zstd", use_dictionary=texts, column_encoding=encoding)
