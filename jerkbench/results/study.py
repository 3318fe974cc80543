"""A study's folder: its rows, tables and manifest, made from the cells that are there, as often as one likes."""

import json
import os
import platform
import sys
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from jerkbench.cells.labels import Labels
from jerkbench.cells.provenance import git_commit, versions
from jerkbench.errors import JerkbenchError, unknown
from jerkbench.files import exists, read_text, write_atomically, write_text
from jerkbench.places import is_remote
from jerkbench.plain import plain
from jerkbench.report.analysis.rule import SPENDS
from jerkbench.results.conditions import Values, conditions, told_apart
from jerkbench.results.content import Content, frame
from jerkbench.results.csv_writer import write_rows_csv
from jerkbench.results.part_shape import HEAD
from jerkbench.results.shape import is_manifest
from jerkbench.results.shown_cells import Current, current
from jerkbench.results.store import Store

if TYPE_CHECKING:
    from jerkbench.report.tables.table_model import Table

MANIFEST = "manifest.json"
PAPER = "experiment=paper"
"""In the command of the study that the paper's claim is about."""

TAGS = "tags"
"""Column of rows, where any cell has tags: separated by blanks."""

Metadata = Mapping[str, Any]
"""What is known of a cell."""


@dataclass(frozen=True, eq=False)
class Study:
    """The results of a study.

    Attributes:
        folder: where they are.
        rows: one row a cell and seed, in the order of the sweeps.
        notes: sentences that belong under its tables.
        keys: key of the cell of each row.
        code: the commits that its cells come from, in a few words.
        conditions: what each cell was measured under, by key.
        damaged: keys of the cells that cannot be read.
        unlike: sentences about the labels of which not all cells were measured under the same conditions.
        of_the_paper: whether it asks whether the paper's claim holds; of any other nothing is said about that.
    """

    folder: Path
    rows: pd.DataFrame
    notes: tuple[str, ...]
    keys: pd.Series
    code: str = ""
    conditions: Mapping[str, Mapping[str, Values]] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()
    of_the_paper: bool = False

    @classmethod
    def open(cls, folder: Path | str) -> "Study":
        """Read the study in ``folder``.

        Raises:
            JerkbenchError: there is no cell.
        """
        return load_study(Path(folder))

    def _repr_html_(self) -> str:
        """Return its main table, as a notebook shows it."""
        from jerkbench.report.tables.summary import main_metric, summarise

        return str(summarise(self.rows, main_metric(self.rows), notes=self.notes)._repr_html_())

    @property
    def combinations(self) -> int:
        """Return the number of combinations; shards of one count once."""
        return len(self.rows[[*Labels._fields]].drop_duplicates())

    def only(self, keys: Iterable[str]) -> "Study":
        """The same study with the cells ``keys`` alone."""
        chosen = self.keys.isin(list(keys))
        return replace(self, rows=self.rows[chosen].reset_index(drop=True), keys=self.keys[chosen])


def load_study(folder: Path, prefer: Collection[str] = ()) -> Study:
    """Read the cells of a study; of several with the same name, one.

    Cells that were not measured under the same conditions (data, protocol, engine) get names that say so.

    Args:
        folder: the study's.
        prefer: keys that are taken before others of the same name; without them those of the last run, then the newest.

    Raises:
        JerkbenchError: there is no cell.
    """
    content, broken = Store(folder).content()
    if content is None or not content.keys:
        held = f"no results but {len(broken)} damaged files" if broken else "no results"
        raise JerkbenchError(f"{folder} holds {held}; `jerkbench run` writes them there (cells/*.parquet).")
    manifest = read_manifest(folder)
    order = {key: place for place, key in enumerate(dict.fromkeys([*manifest.get("cells", []), *prefer]))}
    chosen = current(content, order, set(prefer or manifest.get("last", [])))
    cells = [content.metadata[place] for place in chosen.places]
    keys = [content.keys[place] for place in chosen.places]
    known = conditions(cells)
    labels, unlike = told_apart(cells, known)
    rows, counts = _rows(content, chosen.places, labels)
    spent = [level for key in keys if (level := manifest.get("levels", {}).get(key)) is not None]
    rows.attrs.update({SPENDS: min(spent)} if spent else {})
    notes = [*unlike, *_notes(keys, cells, manifest), *_remarks(cells, chosen, broken)]
    by_key = dict(zip(keys, known, strict=True))
    of_rows = pd.Series(np.repeat(np.array(keys, dtype=object), counts))
    if tags := manifest.get("tags"):
        rows[TAGS] = [" ".join(tags.get(key, [])) for key in of_rows]
    of_the_paper = PAPER in manifest.get("command", ())
    return Study(folder, rows, tuple(notes), of_rows, _code(cells), by_key, tuple(broken), tuple(unlike), of_the_paper)


def _rows(
    content: Content, places: Sequence[int], labels: Sequence[Mapping[str, str]]
) -> tuple[pd.DataFrame, list[int]]:
    """The rows of some cells, in this order and with these labels, and the number of rows of each."""
    orders = {id(content.columns[place]): content.columns[place] for place in places}
    rows = frame(content.rows_in_order(places), dict.fromkeys([*HEAD, *chain(*orders.values())]))
    counts = [int(content.starts[place + 1] - content.starts[place]) for place in places]
    for name in Labels._fields:
        rows[name] = pd.Series(np.repeat(np.array([own[name] for own in labels], dtype=object), counts), dtype="str")
    return rows, counts


def tagged(study: Study, tag: str) -> Study:
    """Return the study with those of its cells that have the ``tag``.

    Raises:
        JerkbenchError: none has.
    """
    words = study.rows[TAGS].str.split() if TAGS in study.rows else pd.Series([[]] * len(study.rows))
    keys = study.keys[[tag in own for own in words]].unique()
    if not len(keys):
        raise JerkbenchError(unknown("tag", tag, {word for own in words for word in own}))
    return study.only(keys)


def write_study(study: Study) -> "Table":
    """Write rows.csv and the tables; returns the first of these."""
    from jerkbench.report.tables.study_tables import write_tables

    write_atomically(study.folder / "rows.csv", lambda path: write_rows_csv(study.rows, path))
    return write_tables(study.rows, study.folder, study.notes)


def write_manifest(
    folder: Path,
    keys: Sequence[str],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None = None,
    tags: Sequence[str] = (),
) -> None:
    """Write what was run, by which code, on which machine; the order and the notes of earlier cells are kept.

    Of two processes in one folder each adds to what the other has written. Where seeds were added in blocks, ``level``
    is what the last look at the cells ``keys`` may spend. ``tags`` are added to those that the cells have.
    """
    from filelock import FileLock

    with nullcontext() if is_remote(folder) else FileLock(folder / ".manifest.lock"):
        _write_manifest(folder, keys, notes, command, level, tags)


def _write_manifest(
    folder: Path,
    keys: Sequence[str],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None,
    tags: Sequence[str],
) -> None:
    before = read_manifest(folder)
    manifest = {
        "cells": list(dict.fromkeys([*before.get("cells", []), *keys])),
        "last": list(keys),
        "notes": {**before.get("notes", {}), **{key: list(notes) for key in keys}},
        "levels": {**before.get("levels", {}), **(dict.fromkeys(keys, level) if level is not None else {})},
        "tags": _tagged(before.get("tags", {}), keys, tags),
        "command": list(command),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": versions(),
        "commit": git_commit(),
        "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
    }
    write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def _tagged(before: Mapping[str, list[str]], keys: Sequence[str], tags: Sequence[str]) -> dict[str, list[str]]:
    added = {key: list(dict.fromkeys([*before.get(key, []), *tags])) for key in keys} if tags else {}
    return {**before, **added}


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest; empty where there is none yet."""
    path = folder / MANIFEST
    if not is_remote(path) and not exists(path):
        return {}
    try:
        if is_remote(path) or path.is_file():  # a pipe would be waited for
            manifest: dict[str, Any] = json.loads(read_text(path))
            if is_manifest(manifest):
                return manifest
    except FileNotFoundError:
        return {}
    except (ValueError, RecursionError):  # no text, or no JSON
        pass
    print(f"{path} is damaged and left aside; `jerkbench run` makes it anew.", file=sys.stderr)
    return {}


def _notes(keys: Sequence[str], cells: Sequence[Metadata], manifest: dict[str, Any]) -> list[str]:
    """Return the notes of the configuration, and then of the recordings, about the cells that are shown."""
    configured = [note for key in keys for note in manifest.get("notes", {}).get(key, [])]
    return list(dict.fromkeys([*configured, *(note for cell in cells for note in cell["notes"])]))


def _code(cells: Sequence[Metadata]) -> str:
    """The commit, or how many there are; without one the beginning of the code's hash."""
    named = {cell["commit"] or f"code {cell['code'][:12]}" for cell in cells}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def _remarks(cells: Sequence[Metadata], chosen: Current, broken: list[str]) -> list[str]:
    """Return remarks about the cells that are shown, and about those that are left out."""
    remarks = []
    codes = {(cell["code"], tuple(sorted(cell["versions"].items()))) for cell in cells}
    if len(codes) > 1:
        remarks.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if len(kinds := {kind for cell in cells if (kind := cell.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        remarks.append(f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ.")
    if others := chosen.outdated - chosen.overlapping:
        which = "1 result of the same name" if others == 1 else f"{others} results of the same names"
        remarks.append(f"{which} with other settings, code or data {'is' if others == 1 else 'are'} left out.")
    if chosen.overlapping:
        which = "1 result is" if chosen.overlapping == 1 else f"{chosen.overlapping} results are"
        remarks.append(f"{which} left out: of the same name as another, with some of the same seeds.")
    if broken:
        remarks.append(f"{damaged(broken)} left out: {', '.join(map(plain, broken))}.")
    return remarks


def set_aside(names: list[str]) -> str:
    """Return a sentence about damaged files whose cells run again."""
    cells = "its cells" if len(names) == 1 else "their cells"
    return f"{damaged(names)} set aside, {cells} run again: {', '.join(map(plain, names))}."


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about files of cells that are damaged."""
    return "1 damaged file of cells is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
