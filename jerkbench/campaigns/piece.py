"""The pieces of a campaign: what is run over one scenario, kept in one file, and read back."""

import dataclasses
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.campaigns.entrant import LIMITS, Entrant, knobs_of
from jerkbench.campaigns.protocol import Scenario
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.files import write_atomically
from jerkbench.jobs.cell import Protocol
from jerkbench.jobs.cluster import Cluster
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.key import data_fingerprint
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Row, run_settings
from jerkbench.jobs.scenario_dispatch import done_by_scenario
from jerkbench.tuning.space import Setting
from jerkbench.tuning.trials import DAMAGE

NUMBERS = ("position_rmse_m", "anees")
"""What is kept of a run."""

MARK = b"piece"
"""Where a file says what it is of."""


@dataclass(frozen=True)
class Piece:
    """Settings of some methods over one scenario.

    Attributes:
        name: of its file; the stage comes first.
        number: of the scenario.
        scenario: the scenario.
        tries: each method with its settings.
        seeds: of the runs.
        metrics: what is computed.
        key: of all that its numbers depend on, but what stands here.
        folder: where its file goes; None: it is not stored.
        limits: how each run is judged.
        attitude: name of the plugin; None: that of the data set.
        strict: whether a run that failed, for another reason than that the filter diverged, is an error.
    """

    name: str
    number: int
    scenario: Scenario
    tries: tuple[tuple[Entrant, tuple[Setting, ...]], ...]
    seeds: tuple[int, ...]
    metrics: tuple[str, ...]
    key: str
    folder: Path | None
    limits: Protocol = LIMITS
    attitude: str | None = None
    strict: bool = False

    @property
    def path(self) -> Path:
        """The file of its rows."""
        return (self.folder or Path()) / f"{self.name}.parquet"

    @property
    def maker(self) -> str | None:
        """The key of the code that its file was made with; None where there is no file of this."""
        mark = mark_of(self.path)
        return mark[0] if mark and mark[1:] == json.loads(self._mark)[1:] else None

    @property
    def done(self) -> bool:
        """Whether its file is there, of this and of this code."""
        return self.maker == self.key

    def run(self) -> pd.DataFrame:
        """Run all of it, store it, and return its rows.

        A row has scenario, filter, adaptation, trial, seed, status, reason, what is kept of a run, and seconds.

        Raises:
            PluginError: a run failed, and the piece is strict.
        """
        inputs = Inputs()
        frame = pd.DataFrame([row for of, settings in self.tries for row in self._rows(of, settings, inputs)])
        if self.folder is not None:
            table = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata({MARK: self._mark})
            write_atomically(self.path, lambda path: pq.write_table(table, path))
        return frame

    def read(self) -> pd.DataFrame:
        """Return its stored rows."""
        frame: pd.DataFrame = pq.read_table(self.path).to_pandas()
        return frame

    def _rows(self, entrant: Entrant, settings: Sequence[Setting], inputs: Inputs) -> list[dict[str, Any]]:
        cell = entrant.cell(self.scenario, self.limits, self.metrics, self.attitude)
        space, fingerprint = knobs_of(cell), data_fingerprint(cell.dataset, cell.disturbances)
        cells = [space.applied(cell, setting) for setting in settings]
        for seed in self.seeds:  # beforehand: the time of a run is that of the filter
            inputs.attitude(inputs.recording(cell, fingerprint, seed), cell.attitude)
        begin = time.perf_counter()
        runs = run_settings(cells, self.seeds, fingerprint, 1, inputs)
        seconds = (time.perf_counter() - begin) / (len(cells) * len(self.seeds))
        head = {
            "scenario": self.number,
            "filter": entrant.filter["name"],
            "adaptation": entrant.adaptation["name"],
        }
        return [
            {**head, "trial": trial, **self._kept(row, entrant), "seconds": seconds}
            for trial, several in enumerate(runs)
            for row in several
        ]

    def _kept(self, row: Row, entrant: Entrant) -> dict[str, Any]:
        if self.strict and row["status"] == "failed":
            raise PluginError(f"A run of {entrant.name} failed: {row['reason']}")
        numbers = {column: float(row.get(column, float("nan"))) for column in NUMBERS}
        return {"seed": row["seed"], "status": row["status"], "reason": row.get("reason", ""), **numbers}

    @property
    def _mark(self) -> str:
        """All that its numbers depend on; the key is the first, the settings by method the last."""
        what = (dataclasses.asdict(self.scenario), dataclasses.asdict(self.limits), self.attitude, self.metrics)
        settings = {entrant.name: values for entrant, values in self.tries}
        return json.dumps([self.key, *what, self.seeds, settings], sort_keys=True)


def mark_of(path: Path) -> list[Any]:
    """Return what a file of runs says that it is of: the key first, the settings last; empty where it is none."""
    try:
        return list(json.loads(pq.read_metadata(path).metadata[MARK]))
    except DAMAGE:
        return []


@dataclass(frozen=True)
class Site:
    """Where pieces are run and stored.

    Attributes:
        folder: of what is stored.
        cluster: what runs them.
        workers: number of processes, where the cluster starts them.
        only_stored: read what other code may have computed, and run nothing.
    """

    folder: Path
    cluster: Cluster
    workers: int
    only_stored: bool = False

    def rows(self, pieces: Sequence[Piece], doing: str, unit: str) -> pd.DataFrame:
        """Run the pieces that are not stored yet, and return the rows of all.

        Args:
            pieces: in order of their scenarios.
            doing: what stands beside the bar.
            unit: what is counted there.

        Raises:
            JerkbenchError: a run failed, or is not stored and may not be run.
            OSError: nothing can be stored.
        """
        left = [piece for piece in pieces if not (piece.maker if self.only_stored else piece.done)]
        if left and self.only_stored:
            stage = left[0].name.partition("-")[0]
            raise JerkbenchError(
                f"Of {len(pieces)} files of the stage {stage} in {self.folder}, {len(left)} are missing or of"
                f" other settings, first {left[0].path.name}; run the audit without --stored."
            )
        with Progress(len(pieces), len(pieces) - len(left), doing, unit) as progress:
            cells = {entrant.text: entrant for piece in left for entrant, _ in piece.tries}.values()
            known = [entrant.cell(left[0].scenario, left[0].limits) for entrant in cells]
            for _ in done_by_scenario(Piece.run, left, known, self.cluster, self.workers) if left else ():
                progress.advance()
        return pd.concat([piece.read() for piece in pieces], ignore_index=True)

    def makers(self) -> list[str]:
        """Return the keys of the code that computed what is stored."""
        return sorted({mark[0] for path in self.folder.glob("*.parquet") if (mark := mark_of(path))})
