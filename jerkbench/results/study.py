"""A study's folder: its rows, tables and manifest, made from the cells that are there, as often as one likes."""

import json
import os
import platform
import sys
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from jerkbench.cells.provenance import git_commit, versions
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_text
from jerkbench.plain import plain
from jerkbench.report.analysis.comparison import SPENDS
from jerkbench.results.conditions import Values, conditions, told_apart
from jerkbench.results.shape import is_manifest
from jerkbench.results.store import Store, Stored

MANIFEST = "manifest.json"
RECORDED = ("labels", "spec", "protocol", "data", "code", "versions", "commit")
"""The entries of each cell in the manifest."""


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
    """

    folder: Path
    rows: pd.DataFrame
    notes: tuple[str, ...]
    keys: pd.Series
    code: str = ""
    conditions: Mapping[str, Mapping[str, Values]] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()

    @property
    def combinations(self) -> int:
        """Return the number of cells."""
        return len(self.keys.unique())

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
    cells, broken = Store(folder).read()
    if not cells:
        content = f"no results but {len(broken)} damaged files" if broken else "no results"
        raise JerkbenchError(f"{folder} holds {content}; `jerkbench run` writes them there (cells/*.parquet).")
    manifest = read_manifest(folder)
    preferred = set(prefer or manifest.get("last", []))
    current = _current(_ordered(cells, manifest.get("cells", [])), preferred)
    labels, unlike = told_apart(current)
    rows = pd.concat([cell.rows.assign(**own) for cell, own in zip(current, labels, strict=True)], ignore_index=True)
    spent = [level for cell in current if (level := manifest.get("levels", {}).get(cell.key)) is not None]
    rows.attrs.update({SPENDS: min(spent)} if spent else {})
    keys = pd.Series([cell.key for cell in current for _ in range(len(cell.rows))])
    notes = [*unlike, *_notes(current, manifest), *_remarks(current, len(cells) - len(current), broken)]
    known = {cell.key: conditions(cell.metadata) for cell in current}
    return Study(folder, rows, tuple(notes), keys, _code(current), known, tuple(broken), tuple(unlike))


def write_study(study: Study) -> None:
    """Write rows.csv and the tables."""
    from jerkbench.report.tables.study_tables import write_tables

    write_text(study.folder / "rows.csv", study.rows.to_csv(index=False))
    write_tables(study.rows, study.folder, study.notes)


def write_manifest(
    folder: Path, keys: Sequence[str], notes: Sequence[str], command: Sequence[str], level: float | None = None
) -> None:
    """Write what was run, by which code, on which machine; the order and the notes of earlier cells are kept.

    Of two processes in one folder each adds to what the other has written. Where seeds were added in blocks, ``level``
    is what the last look at the cells ``keys`` may spend.
    """
    from filelock import FileLock

    with FileLock(folder / ".manifest.lock"):
        _write_manifest(folder, keys, notes, command, level)


def _write_manifest(
    folder: Path, keys: Sequence[str], notes: Sequence[str], command: Sequence[str], level: float | None
) -> None:
    before = read_manifest(folder)
    stored = [(cell.key, cell.metadata) for cell in Store(folder).read()[0]]
    manifest = {
        "cells": list(dict.fromkeys([*before.get("cells", []), *keys])),
        "last": list(keys),
        "notes": {**before.get("notes", {}), **{key: list(notes) for key in keys}},
        "levels": {**before.get("levels", {}), **(dict.fromkeys(keys, level) if level is not None else {})},
        "command": list(command),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": versions(),
        "commit": git_commit(),
        "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
        "configuration": {key: {part: metadata[part] for part in RECORDED} for key, metadata in stored},
    }
    write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest; empty where there is none yet."""
    path = folder / MANIFEST
    if not os.path.lexists(path):
        return {}
    try:
        manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        sound = path.is_file() and is_manifest(manifest)
    except (ValueError, RecursionError):  # no text, or no JSON
        sound = False
    if sound:
        return manifest
    print(f"{path} is damaged and left aside; `jerkbench run` makes it anew.", file=sys.stderr)
    return {}


def _ordered(cells: list[Stored], order: list[str]) -> list[Stored]:
    """In the order of the sweeps; cells that no manifest knows come last, by their labels."""
    place = {key: index for index, key in enumerate(order)}
    return sorted(cells, key=lambda cell: (place.get(cell.key, len(place)), list(cell.metadata["labels"].values())))


def _current(cells: list[Stored], preferred: set[str]) -> list[Stored]:
    """Of several results with the same labels, the preferred one, else the newest."""
    chosen: dict[tuple[str, ...], Stored] = {}

    def rank(cell: Stored) -> tuple[bool, str]:
        return cell.key in preferred, cell.metadata["created"]

    for cell in cells:
        name = tuple(cell.metadata["labels"].values())
        if name not in chosen or rank(cell) > rank(chosen[name]):
            chosen[name] = cell
    return list(chosen.values())


def _notes(current: list[Stored], manifest: dict[str, Any]) -> list[str]:
    """Return the notes of the configuration, and then of the recordings, about the cells that are shown."""
    configured = [note for cell in current for note in manifest.get("notes", {}).get(cell.key, [])]
    return list(dict.fromkeys([*configured, *(note for cell in current for note in cell.metadata["notes"])]))


def _code(current: list[Stored]) -> str:
    """The commit, or how many there are; without one the beginning of the code's hash."""
    named = {cell.metadata["commit"] or f"code {cell.metadata['code'][:12]}" for cell in current}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def _remarks(current: list[Stored], outdated: int, broken: list[str]) -> list[str]:
    """Return remarks about the cells that are shown, and about those that are left out."""
    remarks = []
    codes = {json.dumps([cell.metadata["code"], cell.metadata["versions"]], sort_keys=True) for cell in current}
    if len(codes) > 1:
        remarks.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if outdated:
        which = "1 result of the same name" if outdated == 1 else f"{outdated} results of the same names"
        remarks.append(f"{which} with other settings, code or data {'is' if outdated == 1 else 'are'} left out.")
    if broken:
        remarks.append(f"{damaged(broken)} left out: {', '.join(map(plain, broken))}.")
    return remarks


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about cells whose files are damaged."""
    return "1 damaged file of a cell is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
