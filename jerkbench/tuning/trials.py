"""The trials of a search: settings with what they were worth on each case, stored as they are done."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_atomically
from jerkbench.tuning.space import Setting

DAMAGE = (OSError, ValueError, KeyError, TypeError, pa.ArrowException)
"""Errors of pyarrow on a damaged file; its trials are run again."""


@dataclass(frozen=True, eq=False)
class Trials:
    """Settings, in the order in which they were tried.

    Attributes:
        settings: n of them.
        runs: (n, r) loss of each of its runs.
        case: (r,) which case each of them is of.
        lost: (n,) how many of its runs were lost.
    """

    settings: tuple[Setting, ...]
    runs: FloatArray
    case: IntArray
    lost: FloatArray

    @property
    def losses(self) -> FloatArray:
        """(n, cases) mean loss on each case, over its draws."""
        cases = range(int(self.case.max(initial=-1)) + 1)
        return np.column_stack([self.runs[:, self.case == k].mean(axis=1) for k in cases])

    @property
    def means(self) -> FloatArray:
        """(n,) mean loss over the cases: the objective."""
        return np.asarray(self.losses.mean(axis=1))

    def best(self, count: int) -> list[int]:
        """Return the places of the ``count`` best, the best first; of equals the earlier."""
        return [int(k) for k in np.argsort(self.means, kind="stable")[:count]]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.settings)


def joined_trials(parts: Sequence[Trials]) -> Trials:
    """Return several as one."""
    settings = tuple(setting for part in parts for setting in part.settings)
    runs, lost = (np.concatenate(arrays) for arrays in ([p.runs for p in parts], [p.lost for p in parts]))
    return Trials(settings, runs, parts[0].case, lost)


class TrialStore:
    """Blocks of trials in a folder, one Parquet file each, named by the place of their first."""

    def __init__(self, folder: Path | None, key: str) -> None:
        """Open the blocks of the search ``key`` in ``folder``; None: nothing is stored."""
        self._folder, self._key = folder, key

    def read(self, name: str, begin: int, settings: Sequence[Setting]) -> Trials | None:
        """Return the block of ``settings`` that begins at ``begin``; None where it is not there, or is another."""
        if self._folder is None:
            return None
        try:
            table = pq.read_table(self._path(name, begin))
            head = table.schema.metadata
            stored = json.loads(head[b"settings"]), head[b"key"].decode()
        except DAMAGE:
            return None
        if stored != ([list(setting) for setting in settings], self._key):
            return None
        runs = np.column_stack([table[name].to_numpy() for name in table.column_names if name.startswith("run.")])
        return Trials(tuple(settings), runs, np.array(json.loads(head[b"case"])), table["lost"].to_numpy())

    def write(self, name: str, begin: int, trials: Trials) -> None:
        """Store a block; a reader sees the whole of it or nothing.

        Raises:
            JerkbenchError: nothing can be written there.
        """
        if self._folder is None:
            return
        columns = {f"run.{k}": column for k, column in enumerate(trials.runs.T)}
        head = {"settings": json.dumps(trials.settings), "case": json.dumps(trials.case.tolist()), "key": self._key}
        table = pa.table({**columns, "lost": trials.lost}).replace_schema_metadata(head)
        path = self._path(name, begin)
        try:
            write_atomically(path, lambda partial: pq.write_table(table, partial))
        except OSError as error:
            raise JerkbenchError(f"Trials cannot be stored in {path.parent}: {error.strerror}.") from error

    def _path(self, name: str, begin: int) -> Path:
        return (self._folder or Path()) / "trials" / f"{name}-{begin:05}.parquet"


def trial_table(trials: Trials, names: Sequence[str], scenarios: Sequence[str]) -> pd.DataFrame:
    """Return a row for each trial: its number, its values, the loss of each scenario and their mean."""
    values = np.array(trials.settings, dtype=np.float64).reshape(len(trials), len(names))
    columns: dict[str, Any] = {"trial": range(len(trials))}
    columns |= {name: values[:, k] for k, name in enumerate(names)}
    columns |= {f"loss: {scenario}": trials.losses[:, k] for k, scenario in enumerate(scenarios)}
    return pd.DataFrame({**columns, "loss": trials.means, "lost_runs": trials.lost})
