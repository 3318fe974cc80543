"""A study: the rows of its jobs with their notes, read from the store; its tables; and the parts that names select."""

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
from jerkbench.jobs.manifest import read_manifest, stretches, write_manifest
from jerkbench.jobs.store import HEAD_COLUMNS, Store, Stored, frame
from jerkbench.renamed import new_label
from jerkbench.report.comparisons import SPENDS
from jerkbench.report.conditions import conditions, told_apart, with_one_name
from jerkbench.report.labels import Labels, bare
from jerkbench.report.study_notes import LeftOut, code_of, notes_of_study
from jerkbench.report.writers import write_rows_csv

if TYPE_CHECKING:
    from jerkbench.report.table_model import Table


@dataclass(frozen=True, eq=False)
class Study:
    """The results of a study.

    Attributes:
        folder: where they are.
        rows: one row a cell and seed, in the order of the sweeps.
        notes: sentences that belong under its tables.
        keys: key of the cell of each row.
        code: the commits that its cells come from, in a few words.
        metadata: what is stored of each job, by key.
        damaged: keys of the cells that cannot be read.
        unlike: sentences about the labels of which not all cells were measured under the same conditions.
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
        """Read the study in ``folder``.

        Raises:
            JerkbenchError: there is no cell.
        """
        return load_study(Path(folder))

    def __repr__(self) -> str:
        """Return its folder and its size, and what was lost."""
        lost = int((self.rows["status"] != "ok").sum())
        return f"Study({str(self.folder)!r}, {self.combinations} combinations, {len(self.rows)} runs, {lost} lost)"

    def _repr_html_(self) -> str:
        """Return its main table, as a notebook shows it."""
        from jerkbench.report.summary import main_metric, summarise

        return str(summarise(self.rows, main_metric(self.rows), notes=self.notes)._repr_html_())

    @property
    def combinations(self) -> int:
        """Return the number of combinations; shards of one count once."""
        return len(self.rows[[*Labels._fields]].drop_duplicates())

    @property
    def labels(self) -> dict[str, dict[str, str]]:
        """Return the labels of each cell by its key, as the tables have them."""
        first = ~self.keys.duplicated()
        records = self.rows.loc[first.to_numpy(), [*Labels._fields]].to_dict("records")
        return dict(zip(self.keys[first], records, strict=True))

    def only(self, keys: Iterable[str]) -> "Study":
        """The same study with the cells ``keys`` alone."""
        chosen = self.keys.isin(list(keys)).to_numpy()
        rows, keys_of_rows = self.rows[chosen].reset_index(drop=True), self.keys[chosen].reset_index(drop=True)
        metadata = {key: self.metadata[key] for key in dict.fromkeys(keys_of_rows)}
        return replace(self, rows=rows, keys=keys_of_rows, metadata=metadata)


def load_study(folder: Path, seeds: Mapping[str, Sequence[int]] | None = None) -> Study:
    """Read a study. Of several jobs with the same labels, that of the last command is shown, otherwise the newest.

    Jobs that were not measured under the same conditions (data, protocol, engine) get labels that say so.

    Args:
        folder: of the study.
        seeds: jobs that are shown instead of those of the last command, with their seeds.

    Raises:
        JerkbenchError: there are no results.
    """
    manifest = read_manifest(folder)
    named = {key: stretches(own) for key, own in (seeds or {}).items()}
    stored, damaged = Store(folder).read(shown={**manifest.get("seeds", {}), **named})
    if not stored:
        held = f"no results but {len(damaged)} damaged files" if damaged else "no results"
        raise JerkbenchError(f"{folder} holds {held}; `jerkbench run` writes them there (cells/*.parquet).")
    known = {job.key: conditions(job.metadata) for job in stored}
    labels = {job.key: dict(job.metadata["labels"]) for job in stored}
    with_one_name(list(labels.values()), list(known.values()))
    order = {key: place for place, key in enumerate(dict.fromkeys([*manifest.get("cells", []), *named]))}
    chosen = _current(stored, labels, order, set(named or manifest.get("last", [])))
    keys, about = [job.key for job in chosen], [job.metadata for job in chosen]
    unlike = told_apart([labels[key] for key in keys], [known[key] for key in keys])
    rows = frame(pa.concat_tables([job.table for job in chosen]), chain(HEAD_COLUMNS, *(job.columns for job in chosen)))
    keys_of_rows = np.repeat(np.array(keys, dtype=object), [len(job.table) for job in chosen])
    for name in Labels._fields:
        rows[name] = pd.Series([labels[key][name] for key in keys_of_rows], dtype="str")
    spent = [level for key in keys if (level := manifest.get("levels", {}).get(key)) is not None]
    rows.attrs.update({SPENDS: min(spent)} if spent else {})
    configured = [note for key in keys for note in manifest.get("notes", {}).get(key, [])]
    left_out = LeftOut(len(stored) - len(chosen), sum(job.others for job in stored), damaged)
    notes = notes_of_study(rows, about, [*unlike, *configured], left_out)
    return Study(
        folder,
        rows,
        tuple(notes),
        keys=pd.Series(keys_of_rows),
        code=code_of(about),
        metadata=dict(zip(keys, about, strict=True)),
        damaged=tuple(damaged),
        unlike=tuple(unlike),
    )


def _current(
    stored: Sequence[Stored],
    labels: Mapping[str, Mapping[str, str]],
    order: Mapping[str, int],
    preferred: Collection[str],
) -> list[Stored]:
    """Return one job for each combination of labels: a preferred one, otherwise the newest, in ``order``."""
    groups: dict[tuple[str, ...], list[Stored]] = {}
    for job in sorted(stored, key=lambda job: (order.get(job.key, len(order)), tuple(labels[job.key].values()))):
        groups.setdefault(tuple(labels[job.key].values()), []).append(job)
    return [max(own, key=lambda job: (job.key in preferred, job.metadata["created"])) for own in groups.values()]


def concluded(
    folder: Path,
    seeds: Mapping[str, Sequence[int]],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None = None,
) -> tuple[Study, "Table"]:
    """Write manifest, rows and tables of a study after a command; returns it, and the first of the tables.

    The arguments are those of `write_manifest`.
    """
    write_manifest(folder, seeds, notes, command, level)
    study = load_study(folder)
    return study, write_study(study)


def write_study(study: Study) -> "Table":
    """Write rows.csv and the tables; returns the first of these."""
    from jerkbench.report.summary import write_tables

    write_atomically(study.folder / "rows.csv", lambda path: write_rows_csv(study.rows, path))
    return write_tables(study.rows, study.folder, study.notes)


def named_part(study: Study, names: Sequence[str], factors: Sequence[str]) -> Study:
    """Return the part of a study that has one of some names.

    A name is a label of one of the factors, with its parameters or without, or several of them joined by ``+``.

    Raises:
        JerkbenchError: nothing has one of the names.
    """
    rows = study.rows[[*factors]].astype(str)
    labels = {label: {label, bare(label)} for label in np.unique(rows)}
    fits = np.zeros(len(rows), dtype=bool)
    for name in (reduce(lambda told, factor: new_label(factor, told), factors, name) for name in names):
        of_name = [
            np.any([rows[factor].map(lambda label, one=one: one in labels[label]) for factor in factors], axis=0)
            for one in ([name] if any(name in known for known in labels.values()) else name.split("+"))
        ]
        if not np.all(of_name, axis=0).any():
            raise JerkbenchError(unknown("method" if "filter" in factors else "scenario", name, labels))
        fits |= np.all(of_name, axis=0)
    return study.only(study.keys[fits])
