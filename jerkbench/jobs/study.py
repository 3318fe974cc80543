"""Functions that read the rows and notes of a study, write its tables, and select a part of a study by names."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.files import write_atomically
from jerkbench.jobs.manifest import JobSeeds, read_manifest, stretches, write_manifest
from jerkbench.jobs.store import HEAD_COLUMNS, Store, Stored, frame
from jerkbench.renamed import new_label
from jerkbench.report.comparisons import SPENDS
from jerkbench.report.labels import Labels, bare, conditions, with_distinct_labels, with_one_name
from jerkbench.report.summary import code_of, main_metric, notes_of_part, notes_of_study, summarise, write_tables
from jerkbench.report.writers import write_rows_csv

if TYPE_CHECKING:
    from jerkbench.report.table_model import Table


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
    rows = frame(
        pa.concat_tables([job.table for job in current]), chain(HEAD_COLUMNS, *(job.columns for job in current))
    )
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
