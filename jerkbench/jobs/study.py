"""The results of a study: reading of its rows and notes, writing of its tables, and repetition of its runs."""

import json
import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, plain, shortened, unknown
from jerkbench.estimate import Estimate
from jerkbench.evaluation.evaluated_run import RUN_COLUMNS
from jerkbench.files import write_atomically
from jerkbench.filters.trajectory import Command
from jerkbench.jobs.job import Job, Protocol, build, plugin_errors
from jerkbench.jobs.key import (
    JobSeeds,
    code_digest,
    plugin_packages,
    read_manifest,
    require_data,
    stretches,
    versions,
    write_manifest,
)
from jerkbench.jobs.rows import Row, job_rows, run_seed
from jerkbench.jobs.store import HEAD_COLUMNS, Store, Stored, frame
from jerkbench.recording import Recording
from jerkbench.renamed import new_label
from jerkbench.report.comparisons import SPENDS
from jerkbench.report.labels import Labels, bare, conditions, with_distinct_labels, with_one_name
from jerkbench.report.summary import code_of, main_metric, notes_of_part, notes_of_study, summarise, write_tables
from jerkbench.report.writers import write_rows_csv

if TYPE_CHECKING:
    from jerkbench.report.table_model import Table

MAX_SPEC_CHARACTERS = 100_000
"""Maximum length of a stored specification. The specifications of this project have a few thousand characters."""

SHOWN_CHARS = 200
"""Maximum number of characters of a command that a message shows."""

SAME_WITHIN = 1e-9
"""Relative difference up to which two numbers count as equal, because rounding depends on the processor."""


@dataclass(frozen=True, eq=False)
class Study:
    """The results of a study.

    Attributes:
        folder: The folder of the study.
        rows: One row for each job and seed. The jobs are in the order in which commands ran them.
        notes: Notes that are printed below the tables.
        keys: For each row, the key of its job.
        code: Short text with the commits of the code that computed the rows.
        metadata: The stored metadata of each job, by the key of the job.
        damaged: Names of the files that cannot be read.
        unlike: Notes about labels to which conditions were added, because jobs with these labels ran under different
            conditions.
    """

    folder: Path
    rows: pd.DataFrame
    notes: tuple[str, ...]
    keys: pd.Series
    code: str = ""
    metadata: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()

    @classmethod
    def open(cls, folder: Path | str) -> "Study":
        """Return the study that is stored in ``folder``.

        Raises:
            JerkbenchError: The folder has no results.
        """
        return load_study(Path(folder))

    def __repr__(self) -> str:
        unsuccessful = int((self.rows["status"] != "ok").sum())
        size = f"{self.combinations} combinations, {len(self.rows)} runs, {unsuccessful} diverged or failed"
        return f"Study({str(self.folder)!r}, {size})"

    def _repr_html_(self) -> str:
        """Return the main table of the study as HTML for notebooks."""
        return str(summarise(self.rows, main_metric(self.rows), notes=self.notes)._repr_html_())

    @property
    def combinations(self) -> int:
        """The number of combinations. Jobs with the same labels count as one combination."""
        return len(self.rows[[*Labels._fields]].drop_duplicates())

    @property
    def labels(self) -> dict[str, dict[str, str]]:
        """The labels of each job as {key of the job: {factor: label}}."""
        first = ~self.keys.duplicated()
        records = self.rows.loc[first.to_numpy(), [*Labels._fields]].to_dict("records")
        return dict(zip(self.keys[first], records, strict=True))

    def only(self, keys: Iterable[str]) -> "Study":
        """Return a copy of the study that contains only the jobs with the given keys, and their notes."""
        mask = self.keys.isin(list(keys)).to_numpy()
        rows, keys_of_rows = self.rows[mask].reset_index(drop=True), self.keys[mask].reset_index(drop=True)
        metadata = {key: self.metadata[key] for key in dict.fromkeys(keys_of_rows)}
        notes = notes_of_part(self.notes, self.metadata.values(), metadata.values())
        return replace(self, rows=rows, keys=keys_of_rows, notes=notes, metadata=metadata)


def load_study(folder: Path, seeds: JobSeeds | None = None) -> Study:
    """Return the stored results of a study.

    If several jobs have the same labels, only the job of the last command is returned. If the last command ran no job
    with these labels, only the newest job is returned. Conditions (data, protocol, engine) in which jobs with the same
    label differ are added to the labels.

    Args:
        folder: The folder of the study.
        seeds: The seeds to return, by the key of the job. Jobs in ``seeds`` have priority over other jobs with the same
            labels. By default, the jobs of the last command have priority.

    Raises:
        JerkbenchError: The folder has no results.
    """
    manifest = read_manifest(folder)
    named = {key: stretches(draws) for key, draws in (seeds or {}).items()}
    stored, damaged = Store(folder).read(shown={**manifest.get("seeds", {}), **named})
    if not stored:
        found = f"no results, but {len(damaged)} damaged files" if damaged else "no results"
        raise JerkbenchError(f"{folder} has {found}; `jerkbench run` writes results (cells/*.parquet).")
    known = {job.key: conditions(job.metadata) for job in stored}
    labels = {job.key: dict(job.metadata["labels"]) for job in stored}
    with_one_name(list(labels.values()), list(known.values()))
    order = {key: position for position, key in enumerate(dict.fromkeys([*manifest.get("cells", []), *named]))}
    current = _current(stored, labels, order, set(named or manifest.get("last", [])))
    keys, about, noted = [job.key for job in current], [job.metadata for job in current], manifest.get("notes", {})
    unlike = with_distinct_labels([labels[key] for key in keys], [known[key] for key in keys])
    columns = chain(HEAD_COLUMNS, *(job.columns for job in current))
    rows = frame(pa.concat_tables([job.table for job in current]), columns)
    keys_of_rows = np.repeat(np.array(keys, dtype=object), [len(job.table) for job in current])
    for name in Labels._fields:
        rows[name] = pd.Series([labels[key][name] for key in keys_of_rows], dtype="str")
    spent = [level for key in keys if (level := manifest.get("levels", {}).get(key)) is not None]
    rows.attrs.update({SPENDS: min(spent)} if spent else {})
    outdated, others = len(stored) - len(current), sum(job.others for job in stored)
    configured = [*unlike, *chain.from_iterable(noted.get(key, []) for key in keys)]
    notes = notes_of_study(rows, about, configured, outdated=outdated, other_runs=others, damaged=damaged)
    return Study(
        folder,
        rows,
        tuple(notes),
        keys=pd.Series(keys_of_rows),
        code=code_of(about),
        metadata={k: {**of, "notes": [*noted.get(k, []), *of["notes"]]} for k, of in zip(keys, about, strict=True)},
        damaged=tuple(damaged),
        unlike=tuple(unlike),
    )


def _current(
    stored: Sequence[Stored], labels: Mapping[str, Any], order: Mapping[str, int], preferred: Collection[str]
) -> list[Stored]:
    """Return one job for each combination of labels. Jobs with a key in ``preferred`` have priority over newer jobs."""
    groups: dict[tuple[str, ...], list[Stored]] = {}
    for job in sorted(stored, key=lambda job: (order.get(job.key, len(order)), tuple(labels[job.key].values()))):
        groups.setdefault(tuple(labels[job.key].values()), []).append(job)
    return [max(group, key=lambda job: (job.key in preferred, job.metadata["created"])) for group in groups.values()]


def concluded(
    folder: Path, seeds: JobSeeds, notes: Sequence[str], command: Sequence[str], level: float | None = None
) -> tuple[Study, "Table"]:
    """Write the manifest, the rows and the tables of a study after a command. Return the study and the first table.

    The arguments have the same meaning as in `write_manifest`.
    """
    write_manifest(folder, seeds, notes, command, level)
    study = load_study(folder)
    return study, write_study(study)


def write_study(study: Study) -> "Table":
    """Write rows.csv and the tables of a study, and return the first table."""
    write_atomically(study.folder / "rows.csv", lambda path: write_rows_csv(study.rows, path))
    return write_tables(study.rows, study.folder, study.notes)


def named_part(study: Study, names: Sequence[str], factors: Sequence[str]) -> Study:
    """Return the part of a study that one of the given names selects.

    A name selects the rows that have this label in one of the ``factors``. The parameters in the label are optional. A
    name may also consist of several labels joined by ``+``.

    Raises:
        JerkbenchError: A name matches no row of the study.
    """
    rows = study.rows[[*factors]].astype(str)
    labels = {label: {label, bare(label)} for label in np.unique(rows)}
    fits = np.zeros(len(rows), dtype=bool)
    for name in (reduce(lambda text, factor: new_label(factor, text), factors, name) for name in names):
        of_name = [
            np.any([rows[factor].map(lambda label, one=one: one in labels[label]) for factor in factors], axis=0)
            for one in ([name] if any(name in known for known in labels.values()) else name.split("+"))
        ]
        if not np.all(of_name, axis=0).any():
            raise JerkbenchError(unknown("method" if "filter" in factors else "scenario", name, labels))
        fits |= np.all(of_name, axis=0)
    return study.only(study.keys[fits])


# The repetition of stored runs.


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
    row = stored.rows.to_dict("records")[seeds.index(draw)]
    return StoredRow(_job_of(stored), draw, row, dict(stored.metadata))  # type: ignore[arg-type]  # keys are strings


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


def relative_difference(before: float, after: float) -> float:
    """Return the difference relative to the larger absolute value, or infinity if exactly one of the values is NaN.

    >>> relative_difference(2.0, 1.0), relative_difference(math.nan, math.nan), relative_difference(1.0, math.nan)
    (0.5, 0.0, inf)
    """
    if before == after or (math.isnan(before) and math.isnan(after)):
        return 0.0
    difference = abs(after - before) / max(abs(before), abs(after))
    return math.inf if math.isnan(difference) else difference
