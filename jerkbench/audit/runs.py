"""The runs of a stage of an audit over one scenario, as they are done and stored: one file a filter and scenario."""

import dataclasses
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.audit.methods import Method, space_of_method
from jerkbench.audit.scenarios import ERROR, Scenario, cell_on
from jerkbench.cells.data import data_fingerprint
from jerkbench.errors import PluginError
from jerkbench.execution.cell_run import Row, run_settings
from jerkbench.execution.inputs import Inputs
from jerkbench.files import write_atomically
from jerkbench.tuning.space import Setting
from jerkbench.tuning.trials import DAMAGE

TEST = "test"
COLUMNS = ("position_rmse_m", "anees")
"""What is kept of a run."""


@dataclass(frozen=True)
class Stage:
    """What is run over one scenario with the methods of one filter.

    Attributes:
        name: "tune", "choose" or "test".
        number: of the scenario.
        scenario: the scenario.
        seeds: of its runs.
        settings: of each method.
        folder: where its file goes.
        key: of all that its numbers depend on, but what stands here.
        attitude: name of the plugin; None: that of the data set.
    """

    name: str
    number: int
    scenario: Scenario
    seeds: tuple[int, ...]
    settings: Mapping[Method, tuple[Setting, ...]]
    folder: Path
    key: str
    attitude: str | None = None

    @property
    def path(self) -> Path:
        """The file of its runs."""
        (model,) = {method.filter for method in self.settings}
        return self.folder / f"{self.name}-{self.number:03}-{model}.parquet"

    @property
    def done(self) -> bool:
        """Whether its file is there, of these settings and of this code."""
        return self.maker == self.key

    @property
    def maker(self) -> str | None:
        """The key of the code that its file was made with; None where there is no file of these settings."""
        mark = mark_of(self.path)
        return mark[0] if mark and mark[1:] == json.loads(self._mark())[1:] else None

    def run(self) -> int:
        """Run all of it and store it; returns how many runs there were."""
        inputs = Inputs()
        rows = [row for method, settings in self.settings.items() for row in self._method(method, settings, inputs)]
        table = pa.Table.from_pandas(pd.DataFrame(rows), preserve_index=False)
        table = table.replace_schema_metadata({"stage": self._mark()})
        write_atomically(self.path, lambda path: pq.write_table(table, path))
        return len(rows)

    def read(self) -> pd.DataFrame:
        """Return its rows: scenario, filter, adaptation, trial, seed, status, and what is kept of a run."""
        frame: pd.DataFrame = pq.read_table(self.path).to_pandas()
        return frame

    def _method(self, method: Method, settings: Sequence[Setting], inputs: Inputs) -> list[dict[str, Any]]:
        metrics = (ERROR, "consistency") if self.name == TEST else (ERROR,)
        cell = cell_on(self.scenario, method.filter, method.adaptation, len(self.seeds), metrics, None, self.attitude)
        space = space_of_method(method, self.scenario)
        cells = [space.applied(cell, setting) for setting in settings]
        begin = time.perf_counter()
        runs = run_settings(cells, self.seeds, data_fingerprint(cell.dataset, cell.disturbances), 1, inputs)
        seconds = (time.perf_counter() - begin) / (len(settings) * len(self.seeds))
        head = {"scenario": self.number, "filter": method.filter, "adaptation": method.adaptation}
        return [
            {**head, "trial": trial, "seed": row["seed"], "seconds": seconds, **_kept(row, method)}
            for trial, rows in enumerate(runs)
            for row in rows
        ]

    def _mark(self) -> str:
        settings = {method.name: values for method, values in self.settings.items()}
        other = [self.attitude] if self.attitude else []
        return json.dumps([self.key, *other, dataclasses.asdict(self.scenario), self.seeds, settings], sort_keys=True)


def mark_of(path: Path) -> list[Any]:
    """Return what a file of runs says that it is of: key, scenario, seeds, settings; empty where it is none."""
    try:
        return list(json.loads(pq.read_metadata(path).metadata[b"stage"]))
    except DAMAGE:
        return []


def _kept(row: Row, method: Method) -> dict[str, Any]:
    """Return status and numbers of a run.

    Raises:
        PluginError: it failed for another reason than that the filter diverged.
    """
    if row["status"] == "failed":
        raise PluginError(f"A run of {method.name} failed: {row['reason']}")
    return {"status": row["status"], **{column: row.get(column, float("nan")) for column in COLUMNS}}
