"""A study's folder: its rows, tables and manifest, made from the cells that are there, as often as one likes."""

import json
import os
import platform
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from jerkbench.benchmark.store import Store, Stored
from jerkbench.benchmark.versions import git_commit, versions
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_text

MANIFEST = "manifest.json"


@dataclass(frozen=True, eq=False)
class Study:
    """The results of a study.

    Attributes:
        folder: where they are.
        rows: one row a cell and seed, in the order of the sweeps.
        notes: sentences that belong under its tables.
        keys: key of the cell of each row.
    """

    folder: Path
    rows: pd.DataFrame
    notes: tuple[str, ...]
    keys: pd.Series

    def only(self, keys: Iterable[str]) -> "Study":
        """The same study with the cells ``keys`` alone."""
        chosen = self.keys.isin(list(keys))
        return Study(self.folder, self.rows[chosen].reset_index(drop=True), self.notes, self.keys[chosen])


def load_study(folder: Path) -> Study:
    """Read every cell of a study.

    Raises:
        JerkbenchError: there is no cell.
    """
    found, broken = Store(folder).read()
    if not found:
        raise JerkbenchError(f"{folder} holds no results; `jerkbench run` writes them there (cells/*.parquet).")
    manifest = read_manifest(folder)
    current, older = _newest(_ordered(found, manifest.get("cells", [])))
    notes = list(dict.fromkeys([*manifest.get("notes", []), *(n for one in current for n in one.about["notes"])]))
    if older:
        notes.append(f"{older} older results of the same combinations (other code or data) are left out.")
    if broken:
        notes.append(f"{len(broken)} damaged files of cells are left out: {', '.join(broken)}.")
    rows = pd.concat([one.rows for one in current], ignore_index=True)
    keys = pd.Series([one.key for one in current for _ in range(len(one.rows))])
    return Study(folder, rows, tuple(notes), keys)


def write_study(study: Study) -> None:
    """Write rows.csv and the tables."""
    from jerkbench.report.tables import write_tables

    write_text(study.folder / "rows.csv", study.rows.to_csv(index=False))
    write_tables(study.rows, study.folder, study.notes)


def write_manifest(folder: Path, keys: Sequence[str], notes: Sequence[str], command: Sequence[str]) -> None:
    """Write what was run, by which code, on which machine; the order of earlier cells is kept."""
    before = read_manifest(folder)
    ours = [(one.key, one.about) for one in Store(folder).read()[0]]
    manifest = {
        "cells": list(dict.fromkeys([*before.get("cells", []), *keys])),
        "notes": list(dict.fromkeys([*before.get("notes", []), *notes])),
        "command": list(command),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": versions(),
        "commit": git_commit(),
        "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
        "data": {about["labels"]["dataset"]: about["data"] for _, about in ours},
        "configuration": {key: {part: about[part] for part in ("labels", "spec", "protocol")} for key, about in ours},
    }
    write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest; empty where there is none yet."""
    path = folder / MANIFEST
    if not path.is_file():
        return {}
    try:
        manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError:
        print(f"{path} is damaged and made anew.", file=sys.stderr)
        return {}
    return manifest


def _ordered(found: list[Stored], order: list[str]) -> list[Stored]:
    """In the order of the sweeps; cells that no manifest knows come last, by their labels."""
    place = {key: index for index, key in enumerate(order)}
    return sorted(found, key=lambda one: (place.get(one.key, len(place)), list(one.about["labels"].values())))


def _newest(found: list[Stored]) -> tuple[list[Stored], int]:
    """Of several results of the same combination only the newest; and how many others there were."""
    newest: dict[str, Stored] = {}
    for one in found:
        same = json.dumps([one.about["labels"], one.about["spec"], one.about["protocol"]], sort_keys=True)
        if same not in newest or one.about["created"] > newest[same].about["created"]:
            newest[same] = one
    return list(newest.values()), len(found) - len(newest)
