"""The runs of an entrant over one scenario, as they are done and stored: one file."""

import hashlib
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.audit.runs import COLUMNS
from jerkbench.cells.data import data_fingerprint
from jerkbench.execution.cell_run import Row, run_settings
from jerkbench.execution.inputs import Inputs
from jerkbench.files import write_atomically
from jerkbench.suite.entrant import Entrant, entrant_cell
from jerkbench.suite.protocol import SuiteProtocol
from jerkbench.tuning.space import Setting, Space
from jerkbench.tuning.trials import DAMAGE


@dataclass(frozen=True)
class Piece:
    """What is run of an entrant over one scenario.

    Attributes:
        number: of the scenario.
        entrant: the method.
        space: what may be tuned of it.
        settings: values of that, each of which is run.
        seeds: of its runs.
        metrics: what is computed.
        protocol: of the suite.
        folder: where its file goes; None: it is not stored.
        key: of all that its numbers depend on, but what stands here.
    """

    number: int
    entrant: Entrant
    space: Space
    settings: tuple[Setting, ...]
    seeds: tuple[int, ...]
    metrics: tuple[str, ...]
    protocol: SuiteProtocol
    folder: Path | None
    key: str

    @property
    def done(self) -> bool:
        """Whether its file is there and is of this."""
        try:
            return bool(pq.read_metadata(self._path).metadata.get(b"piece") == self._mark.encode())
        except DAMAGE:
            return False

    def run(self) -> pd.DataFrame:
        """Run all of it, store it, and return its rows: scenario, trial, seed, status, reason, metrics, seconds."""
        cell = entrant_cell(self.entrant, self.protocol.scenarios[self.number], self.protocol, self.metrics)
        cells = [self.space.applied(cell, setting) for setting in self.settings]
        fingerprint, inputs = data_fingerprint(cell.dataset, cell.disturbances), Inputs()
        for seed in self.seeds:  # beforehand: the time of a run is that of the filter
            inputs.attitude(inputs.recording(cell, fingerprint, seed), cell.attitude)
        begin = time.perf_counter()
        runs = run_settings(cells, self.seeds, fingerprint, 1, inputs)
        seconds = (time.perf_counter() - begin) / (len(cells) * len(self.seeds))
        rows = [self._row(trial, row, seconds) for trial, several in enumerate(runs) for row in several]
        frame = pd.DataFrame(rows)
        if self.folder is not None:
            self._store(frame)
        return frame

    def read(self) -> pd.DataFrame:
        """Return its stored rows."""
        frame: pd.DataFrame = pq.read_table(self._path).to_pandas()
        return frame

    def _store(self, frame: pd.DataFrame) -> None:
        table = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata({"piece": self._mark})
        write_atomically(self._path, lambda path: pq.write_table(table, path))

    def _row(self, trial: int, row: Row, seconds: float) -> dict[str, Any]:
        numbers = {column: float(row.get(column, float("nan"))) for column in COLUMNS}
        head = {"scenario": self.number, "trial": trial, "seed": row["seed"], "status": row["status"]}
        return {**head, "reason": row.get("reason", ""), **numbers, "seconds": seconds}

    @property
    def _mark(self) -> str:
        """A hash of all that its numbers depend on."""
        parts = [
            self.key,
            self.protocol.digest,
            self.number,
            self.entrant.text,
            self.settings,
            self.seeds,
            self.metrics,
        ]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    @property
    def _path(self) -> Path:
        return (self.folder or Path()) / f"{self._mark[:20]}.parquet"
