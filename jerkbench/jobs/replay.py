"""The replay of a stored row from its own configuration; the time that a step of it takes; its files for others."""

import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jerkbench import plugins
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.evaluated_run import RUN_COLUMNS
from jerkbench.filters.command import Command
from jerkbench.jobs.job import Job, Protocol, build
from jerkbench.jobs.key import code_digest, require_data, versions
from jerkbench.jobs.preflight import plugins_in_words
from jerkbench.jobs.rows import Row, job_rows, run_seed
from jerkbench.jobs.store import Store, Stored
from jerkbench.jobs.study import Study, load_study
from jerkbench.notices import plain
from jerkbench.recording import Recording
from jerkbench.report.columns import SCENARIO_FACTORS
from jerkbench.report.labels import Labels

if TYPE_CHECKING:
    import pandas as pd


MAX_SPEC_CHARACTERS = 100_000
"""Characters of a stored specification: the longest of this project's own studies has some thousands."""

SHOWN_CHARS = 200
"""Characters of a command that a sentence shows."""


@dataclass(frozen=True, eq=False)
class StoredRow:
    """A row, and all that is needed to make it again.

    Attributes:
        job: made from the stored specification.
        draw: its seed, or phase.
        row: as it was stored.
        metadata: what else is stored of its cell.
    """

    job: Job
    draw: int
    row: Row
    metadata: dict[str, Any]

    def run(self) -> tuple[Recording, Estimate]:
        """Run it again: what the filter saw, and what it made of it.

        Raises:
            JerkbenchError: the data are other data now.
        """
        self._require_data()
        with plugins_in_words(self.job):
            return run_seed(self.job, self.draw)

    def score(self) -> Row:
        """Run it again as the sweep did; returns its row.

        Raises:
            JerkbenchError: the data are other data now.
        """
        self._require_data()
        (row,), _ = job_rows(self.job, [self.draw], strict=True)
        return row

    def _require_data(self) -> None:
        require_data(self.job.scenario.dataset, self.job.scenario.disturbances, self.metadata["data"])

    @property
    def code_changed(self) -> bool:
        """Whether this package or a library is another than the one that stored the row."""
        return bool(self.metadata["code"] != code_digest() or self.metadata["versions"] != versions())


def stored_row(folder: Path, which: str, *, run_programs: bool = False) -> StoredRow:
    """Find a row of a study.

    Args:
        folder: the study's, or a folder of cells.
        which: the row's number in rows.csv, from 1 on; or the beginning of its cell's key, with ``:SEED`` or its first.
        run_programs: whether a program that the stored configuration names may run.

    Raises:
        JerkbenchError: there is none, or several, or it needs a program that may not run.
    """
    seed: int | None = None
    if which.isdecimal() and len(which) < 6:
        study, number = load_study(folder), int(which)
        if not 1 <= number <= len(study.rows):
            raise JerkbenchError(f"{folder} has the rows 1 to {len(study.rows)}; there is no row {number}.")
        key, seed = str(study.keys.iloc[number - 1]), int(study.rows["seed"].iloc[number - 1])
    else:
        prefix, _, typed_seed = which.partition(":")
        keys = Store(folder).keys_from(prefix)
        if len(keys) != 1 or (typed_seed and not typed_seed.isdecimal()):
            raise JerkbenchError(
                f"'{which}' is no row of {folder}: {len(keys)} cells begin with '{prefix}'. Give the row's number in "
                "rows.csv (from 1), or KEY:SEED, with the name of a file in cells/."
            )
        key, seed = keys[0], int(typed_seed) if typed_seed else None
    stored, _ = Store(folder).read([key])
    if not stored:
        raise JerkbenchError(f"The file of the cell {key} in {folder} is damaged; `jerkbench run` makes it anew.")
    return row_of(stored[0], seed, run_programs=run_programs)


def row_of(stored: Stored, seed: int | None = None, *, run_programs: bool = False) -> StoredRow:
    """Return one row of a stored cell: that of ``seed``, or its first.

    Raises:
        JerkbenchError: it has no such seed, or needs a program that may not run.
    """
    if not run_programs and (program := program_of(stored.metadata["spec"])):
        raise JerkbenchError(
            f"The cell {plain(stored.key)} runs the program {program}. A stored program runs only with"
            " --run-programs; give it if you trust these results."
        )
    seeds = [int(seed) for seed in stored.rows["seed"]]
    draw = seeds[0] if seed is None else seed
    if draw not in seeds:
        raise JerkbenchError(f"The cell {stored.key} has no seed {draw}; it has {', '.join(map(str, seeds))}.")
    metadata = stored.metadata
    row = stored.rows.to_dict("records")[seeds.index(draw)]
    return StoredRow(_job_of(stored), draw, row, metadata)  # type: ignore[arg-type]  # keys are strings


def program_of(spec: Mapping[str, Any]) -> str:
    """Return the command that a stored configuration would run; empty where it runs none."""
    model = spec.get("filter") if isinstance(spec, dict) else None
    if not isinstance(model, dict):
        return ""
    name = str(model.get("name"))
    if name not in plugins.names("filter") or not issubclass(plugins.get("filter", name), Command):
        return ""
    command = " ".join(plain(str(model.get("command"))).split()) or name
    more = len(command) - SHOWN_CHARS
    return f"{command[:SHOWN_CHARS]} ... ({more} more characters)" if more > 0 else command


def runnable(cells: Sequence[Stored], *, run_programs: bool) -> list[Stored]:
    """Return the cells that may run again: without ``run_programs`` those that need no program."""
    return [cell for cell in cells if run_programs or not program_of(cell.metadata["spec"])]


def tell_left_out(study: Study, *, run_programs: bool) -> None:
    """Report on standard error how many jobs of a study will not run again, because they run programs."""
    count = 0 if run_programs else sum(bool(program_of(own["spec"])) for own in study.metadata.values())
    if count:
        cells = "1 cell runs a program. It is" if count == 1 else f"{count} cells run programs. They are"
        print(
            f"jerkbench: {cells} in the tables, but not in what needs a new run; give --run-programs (in Python"
            " run_programs=True) if you trust these results.",
            file=sys.stderr,
        )


def _job_of(stored: Stored) -> Job:
    """The job that the stored configuration describes.

    Raises:
        JerkbenchError: it describes none, at least not for this version of the plugins, or is too large to be true.
    """
    metadata = stored.metadata
    if (size := len(json.dumps(metadata["spec"]))) > MAX_SPEC_CHARACTERS:
        raise JerkbenchError(
            f"The configuration that is stored with the cell {stored.key} has {size} characters, and at most"
            f" {MAX_SPEC_CHARACTERS} are taken: no run writes that much. It is damaged, or forged."
        )
    if "${" in json.dumps(metadata["spec"]):
        raise JerkbenchError(
            f"The configuration that is stored with the cell {stored.key} has an interpolation (${{...}}): a run stores"
            " plain values. It is forged."
        )
    try:
        return build(metadata["spec"], Protocol(**metadata["protocol"]), Labels(**metadata["labels"]))
    except (TypeError, ValueError, ArithmeticError, LookupError, AttributeError) as error:
        raise JerkbenchError(
            f"The configuration that is stored with the cell {stored.key} makes no cell ({error}): it is damaged, or"
            " of another version."
        ) from error


def replay_differences(stored: StoredRow) -> list[tuple[str, float, float]]:
    """Run the row again; return each metric with its stored and its new value.

    Raises:
        JerkbenchError: the run cannot be made again, or ends otherwise than it did.
    """
    replayed = stored.score()
    if replayed["status"] != stored.row["status"]:
        raise JerkbenchError(
            f"The run was {stored.row['status']} and is {replayed['status']} now: {replayed['reason']}"
        )
    skip = {*stored.job.labels._fields, *RUN_COLUMNS}
    names = [name for name in stored.row if name not in skip]  # one that is gone differs
    return [(name, float(stored.row[name]), float(replayed.get(name, math.nan))) for name in names]


SAME_WITHIN = 1e-9
"""Relative difference up to which two numbers are the same: processors round differently."""


def relative_difference(before: float, after: float) -> float:
    """Return the difference relative to the larger value; infinite if one of the values is missing.

    >>> relative_difference(2.0, 1.0), relative_difference(math.nan, math.nan), relative_difference(1.0, math.nan)
    (0.5, 0.0, inf)
    """
    if before == after or (math.isnan(before) and math.isnan(after)):
        return 0.0
    difference = abs(after - before) / max(abs(before), abs(after))
    return math.inf if math.isnan(difference) else difference


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
    scenario = (rows[[*SCENARIO_FACTORS]] == rows[[*SCENARIO_FACTORS]].iloc[0]).all(axis=1)
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
    kept = [name for name in timed if name in {*Labels._fields, *RUN_COLUMNS}]
    return timed[[*kept, COLUMN]].reset_index(drop=True)


def step_ns(stored: StoredRow) -> float:
    """Return the time a step [ns] of the quickest of `REPEATS` runs, after one that prepares everything.

    Raises:
        JerkbenchError: the data are other data now, or a plugin raises an error.
    """
    recording, _ = stored.run()
    seconds = []
    with plugins_in_words(stored.job):
        for _ in range(REPEATS):
            began_s = time.perf_counter()
            run_seed(stored.job, stored.draw)
            seconds.append(time.perf_counter() - began_s)
    return min(seconds) / len(recording.clock_s) * 1e9
