"""Repetition of stored runs, and measurement of the computation time of a filter step."""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, shortened
from jerkbench.estimate import Estimate
from jerkbench.evaluation.evaluated_run import RUN_COLUMNS
from jerkbench.filters.trajectory import Command
from jerkbench.jobs.job import Job, Protocol, build
from jerkbench.jobs.key import code_digest, plugin_packages, require_data, versions
from jerkbench.jobs.preflight import plugin_errors
from jerkbench.jobs.rows import Row, job_rows, run_seed
from jerkbench.jobs.store import Store, Stored
from jerkbench.jobs.study import Study, load_study
from jerkbench.notices import plain
from jerkbench.recording import Recording
from jerkbench.report.labels import Labels

MAX_SPEC_CHARACTERS = 100_000
"""Maximum length of a stored specification. The specifications of this project have a few thousand characters."""

SHOWN_CHARS = 200
"""Maximum number of characters of a command that a message shows."""


@dataclass(frozen=True, eq=False)
class StoredRow:
    """A stored row of results, and the job from which the row can be computed again.

    Attributes:
        job: The job, created from the stored configuration.
        draw: The seed of the row. If the job has no random parts, ``draw`` is the index of the phase of the recording.
        row: The stored row: labels, seed, status and metrics of the run.
        metadata: The stored metadata of the job: configuration, protocol, notes and versions.
    """

    job: Job
    draw: int
    row: Row
    metadata: dict[str, Any]

    def run(self) -> tuple[Recording, Estimate]:
        """Run the row again, and return the recording and the estimate.

        Raises:
            JerkbenchError: The data have changed since the row was stored.
        """
        self._require_data()
        with plugin_errors(self.job):
            return run_seed(self.job, self.draw)

    def score(self) -> Row:
        """Run the row again with the same functions as a sweep, and return the new row.

        Raises:
            JerkbenchError: The data have changed since the row was stored.
        """
        self._require_data()
        (row,), _ = job_rows(self.job, [self.draw], strict=True)
        return row

    def _require_data(self) -> None:
        require_data(self.job.scenario.dataset, self.job.scenario.disturbances, self.metadata["data"])

    @property
    def code_changed(self) -> bool:
        """True if jerkbench or a library that affects results has changed since the row was stored."""
        return bool(self.metadata["code"] != code_digest() or self.metadata["versions"] != versions())


def stored_row(folder: Path, number: int, *, run_programs: bool = False) -> StoredRow:
    """Return one row of a study.

    Args:
        folder: The folder of the study, or a folder that contains its Parquet files.
        number: The number of the row in rows.csv (from 1).
        run_programs: Whether the external program that a stored configuration names may run.

    Raises:
        JerkbenchError: The study has no such row, or the row needs a program that may not run.
    """
    study = load_study(folder)
    if not 1 <= number <= len(study.rows):
        raise JerkbenchError(f"{folder} has no row {number}; give a row from 1 to {len(study.rows)}.")
    key, seed = str(study.keys.iloc[number - 1]), int(study.rows["seed"].iloc[number - 1])
    (stored,), _ = Store(folder).read([key])
    return row_of(stored, seed, run_programs=run_programs)


def row_of(stored: Stored, seed: int | None = None, *, run_programs: bool = False) -> StoredRow:
    """Return the row of a stored job for one seed. If ``seed`` is None, the first seed of the job is used.

    Raises:
        JerkbenchError: The job has no run with this seed, or the job needs a program that may not run.
    """
    if not run_programs and (program := program_of(stored.metadata["spec"])):
        runs = f"The combination {plain(stored.key)} runs the program {program}"
        raise JerkbenchError(f"{runs}. Programs run only with --run-programs; give it if you trust these results.")
    seeds = [int(seed) for seed in stored.rows["seed"]]
    draw = seeds[0] if seed is None else seed
    if draw not in seeds:
        raise JerkbenchError(f"{stored.key} has no seed {draw}; its seeds are {', '.join(map(str, seeds))}.")
    metadata = stored.metadata
    row = stored.rows.to_dict("records")[seeds.index(draw)]
    return StoredRow(_job_of(stored), draw, row, metadata)  # type: ignore[arg-type]  # keys are strings


def program_of(spec: Mapping[str, Any]) -> str:
    """Return the external program (with arguments) that a stored configuration would run, or an empty string."""
    model = spec.get("filter") if isinstance(spec, dict) else None
    if not isinstance(model, dict):
        return ""
    name = str(model.get("name"))
    if name not in plugins.names("filter") or not issubclass(plugins.get("filter", name), Command):
        return ""
    return shortened(" ".join(plain(str(model.get("command"))).split()), SHOWN_CHARS) or name


def runnable(cells: Sequence[Stored], *, run_programs: bool) -> list[Stored]:
    """Return the jobs that may run again.

    Jobs that run an external program are left out unless ``run_programs`` is set.
    """
    return [cell for cell in cells if run_programs or not program_of(cell.metadata["spec"])]


def report_excluded_programs(study: Study, *, run_programs: bool) -> None:
    """Print the number of jobs that are not run again because they would run an external program."""
    count = 0 if run_programs else sum(bool(program_of(metadata["spec"])) for metadata in study.metadata.values())
    if count:
        cells = "1 combination runs a program and is" if count == 1 else f"{count} combinations run programs and are"
        allowing = "give --run-programs (in Python run_programs=True) if you trust these results"
        print(f"jerkbench: {cells} not run again. The tables contain the stored rows; {allowing}.", file=sys.stderr)


def _job_of(stored: Stored) -> Job:
    """Create the job from the stored configuration.

    Raises:
        JerkbenchError: The stored configuration is too large, or is not valid for the installed plugins.
    """
    metadata = stored.metadata
    text, subject = json.dumps(metadata["spec"]), f"The stored configuration of the combination {stored.key}"
    if len(text) > MAX_SPEC_CHARACTERS:
        limit = f"the maximum is {MAX_SPEC_CHARACTERS}"
        raise JerkbenchError(f"{subject} is damaged or forged: it has {len(text)} characters, but {limit}.")
    if "${" in text:
        raise JerkbenchError(f"{subject} was changed after the run: it has an interpolation, ${{...}}.")
    try:
        return build(metadata["spec"], Protocol(**metadata["protocol"]), Labels(**metadata["labels"]))
    except PluginError as error:
        lost = [f"{n}=={v}" for n, v in metadata.get("packages", {}).items() if n not in plugin_packages()]
        if not lost:
            raise
        raise PluginError(f"{error} The run used packages that are not installed: {', '.join(lost)}.") from error
    except (TypeError, ValueError, ArithmeticError, LookupError, AttributeError) as error:
        raise JerkbenchError(f"{subject} is invalid ({error}). The file is damaged or from another version.") from error


def replay_differences(stored: StoredRow) -> list[tuple[str, float, float]]:
    """Repeat a stored run, and return (name, stored value, new value) for each metric.

    Raises:
        JerkbenchError: The run cannot be repeated, or its new status differs from the stored status.
    """
    replayed = stored.score()
    if replayed["status"] != stored.row["status"]:
        now = f"the status of the repeated run is {replayed['status']}: {replayed['reason']}"
        raise JerkbenchError(f"The stored status of the run is {stored.row['status']}, but {now}")
    skip = {*stored.job.labels._fields, *RUN_COLUMNS}
    names = [name for name in stored.row if name not in skip]  # the new value of a missing metric is NaN
    return [(name, float(stored.row[name]), float(replayed.get(name, math.nan))) for name in names]


SAME_WITHIN = 1e-9
"""Relative difference up to which two numbers count as equal, because rounding depends on the processor."""


def relative_difference(before: float, after: float) -> float:
    """Return the difference relative to the larger absolute value, or infinity if exactly one of the values is NaN.

    >>> relative_difference(2.0, 1.0), relative_difference(math.nan, math.nan), relative_difference(1.0, math.nan)
    (0.5, 0.0, inf)
    """
    if before == after or (math.isnan(before) and math.isnan(after)):
        return 0.0
    difference = abs(after - before) / max(abs(before), abs(after))
    return math.inf if math.isnan(difference) else difference
