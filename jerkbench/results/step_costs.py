"""The time that a step of each method takes, measured again on this machine."""

import time
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.evaluated_run import RUN
from jerkbench.jobs.cell import Labels
from jerkbench.jobs.preflight import plugins_in_words
from jerkbench.jobs.rows import CellRun
from jerkbench.results.replay import StoredRow, row_of, runnable
from jerkbench.results.store import Store
from jerkbench.results.study import Study

if TYPE_CHECKING:
    import pandas as pd

SCENARIO = ("dataset", "disturbance", "attitude")
REPEATS = 5
"""Of so many runs the quickest counts: what else the machine does makes a run slower, never quicker."""

COLUMN = "step_ns"


def step_costs(study: Study, *, run_programs: bool = False) -> "pd.DataFrame":
    """Return a row for each method of a study's first scenario, with its cost in the column `COLUMN`.

    Each method runs a seed that went well again, with its trajectory, alone. A step is an IMU sample, of a recording
    without an IMU a fix. Recording, attitude and compilation are not counted. Methods that are programs are
    left out unless ``run_programs``.

    Raises:
        JerkbenchError: no run of the scenario went well, or its data are not there any more.
    """
    rows = study.rows.assign(key=study.keys.to_numpy())
    scenario = (rows[[*SCENARIO]] == rows[[*SCENARIO]].iloc[0]).all(axis=1)
    chosen = rows[scenario & (rows["status"] == "ok")].drop_duplicates("key")
    if chosen.empty:
        raise JerkbenchError(f"No run of the first scenario of {study.folder} went well, so no step can be timed.")
    cells, _ = Store(study.folder).read(list(chosen["key"]))
    by_key = {cell.key: cell for cell in runnable(cells, run_programs=run_programs)}
    chosen = chosen[chosen["key"].isin(list(by_key))]
    stored = [
        row_of(by_key[key], int(seed), run_programs=run_programs)
        for key, seed in zip(chosen["key"], chosen["seed"], strict=True)
    ]
    timed = chosen.assign(replicate="phase", **{COLUMN: [step_ns(row) for row in stored]})
    kept = [name for name in timed if name in {*Labels._fields, *RUN}]
    return timed[[*kept, COLUMN]].reset_index(drop=True)


def step_ns(stored: StoredRow) -> float:
    """Return the time a step [ns] of the quickest of `REPEATS` runs, after one that prepares everything.

    Raises:
        JerkbenchError: the data are other data now, or a plugin raises an error.
    """
    run = CellRun(stored.cell, stored.fingerprint)
    recording, _ = stored.run()
    with plugins_in_words(stored.cell):
        return min(_once_s(run, stored.draw) for _ in range(REPEATS)) / len(recording.clock_s) * 1e9


def _once_s(run: CellRun, draw: int) -> float:
    began_s = time.perf_counter()
    run.once(draw)
    return time.perf_counter() - began_s
