"""An entry: its folder with rows, settings, what it was made with and its score; and the way of a method into it."""

import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import yaml

from jerkbench.errors import JerkbenchError, require_known
from jerkbench.files import cache_folder, read_yaml, write_atomically, write_text
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.replay import program_of
from jerkbench.suite.campaign import AS_GIVEN, ENTRY, PLAIN, SUITE_ERROR, SuiteCampaign, plugins_digest, scored_plain
from jerkbench.suite.protocol import FROZEN, TUNED_ON, SuiteProtocol, read_suite, require_recordings
from jerkbench.suite.scores import EntryScoring, score_as_json
from jerkbench.tuning.entrant import NUMBERS, Entrant, Site
from jerkbench.tuning.space import Setting
from jerkbench.tuning.stored_files import (
    Test,
    file_hashes,
    is_mapping_of,
    is_string,
    is_text,
    read_file,
    read_table,
    require_parts,
    require_regular,
    require_table_columns,
)

_ROWS, SETTINGS, PAGE, ENTRY_FILE = "rows.parquet", "settings.yaml", "entry.md", "manifest.json"
HASHED = (_ROWS, SETTINGS, PAGE)
"""Files whose hashes stand in the manifest."""

_ORIGIN = "An entry is made by `jerkbench suite run`."

_TEXTS, COUNTS = ("method", "tuned_on", "status", "reason"), ("scenario", "seed")
"""Columns of the rows, by their types."""


ROW_COLUMNS = (*_TEXTS[:2], *COUNTS, *_TEXTS[2:], *NUMBERS, "seconds")
"""Of the rows: with the numbers of a run, and the time that it took."""


Settings = Mapping[str, Mapping[str, Mapping[str, float]]]
"""The values by "entry" or "plain", what they were tuned on, and knob."""


@dataclass(frozen=True)
class Entry:
    """An entry as it lies in its folder.

    Attributes:
        folder: where.
        manifest: what it was made with, and its score.
        rows: of the entry and of the plain filter, on the seeds to test on.
        settings: of both.
    """

    folder: Path
    manifest: Mapping[str, Any]
    rows: pd.DataFrame
    settings: Settings

    @property
    def name(self) -> str:
        """What the board calls it."""
        return str(self.manifest["entry"])

    @property
    def entrant(self) -> Entrant:
        """The method."""
        return Entrant(**self.manifest["method"])

    @property
    def program(self) -> str:
        """The command that its method runs; empty where it runs none."""
        return program_of({"filter": self.entrant.filter})

    def setting(self, method: str, tuned_on: str) -> Setting:
        """Return the values of the knobs, in order."""
        return tuple(float(value) for value in self.settings[method][tuned_on].values())


def write_entry(folder: Path, manifest: Mapping[str, Any], rows: pd.DataFrame, settings: Settings, page: str) -> None:
    """Write an entry; the manifest, without which there is none, comes last.

    Raises:
        OSError: it cannot be written.
    """
    kept = rows[list(ROW_COLUMNS)]
    write_atomically(folder / _ROWS, lambda path: kept.to_parquet(path, index=False))
    write_text(folder / SETTINGS, yaml.safe_dump(settings, sort_keys=False))
    write_text(folder / PAGE, page)
    whole = {**manifest, "files": file_hashes(folder, HASHED)}
    write_text(folder / ENTRY_FILE, json.dumps(whole, indent=1) + "\n")


def read_entry(folder: Path) -> Entry:
    """Read an entry.

    Raises:
        JerkbenchError: a part of it is missing or damaged; says which.
    """
    require_regular((folder / name for name in (ENTRY_FILE, *HASHED)), _ORIGIN)
    manifest = _read(folder / ENTRY_FILE, lambda path: json.loads(path.read_text(encoding="utf-8")))
    _require(folder / ENTRY_FILE, {"": isinstance(manifest, dict) or "a JSON object"})
    _require(folder / ENTRY_FILE, {f"'{key}'": test(manifest.get(key)) or what for key, (test, what) in FACTS.items()})
    require_known("suite", manifest["suite"], FROZEN, JerkbenchError)
    settings = _read(folder / SETTINGS, read_yaml)
    _require(folder / SETTINGS, {"": _are_settings(settings) or SETTINGS_SHAPE})
    _read(folder / PAGE, Path.read_bytes)
    return Entry(folder, manifest, _rows(folder / _ROWS), settings)


def _rows(path: Path) -> pd.DataFrame:
    """Read the rows, and check the columns that an entry has."""
    table = _read(path, read_table)
    is_kind = {"numbers": pa.types.is_float64, "text": is_string, "whole numbers": pa.types.is_int64}
    kinds = {
        **dict.fromkeys(ROW_COLUMNS, "numbers"),
        **dict.fromkeys(_TEXTS, "text"),
        **dict.fromkeys(COUNTS, "whole numbers"),
    }
    require_table_columns(path, table, kinds, is_kind, _ORIGIN)
    rows: pd.DataFrame = table.select(list(ROW_COLUMNS)).to_pandas(ignore_metadata=True)
    of_ok = rows.loc[rows["status"] == "ok", SUITE_ERROR]
    times = rows["seconds"]
    positive = ((of_ok > 0) & (of_ok < math.inf)).all()
    _require(path, {f"column '{SUITE_ERROR}'": bool(positive) or "positive and finite where the status is ok"})
    _require(path, {"column 'seconds'": bool(((times >= 0) & (times < math.inf)).all()) or "finite and not negative"})
    return rows


def _read(path: Path, read: Callable[[Path], Any]) -> Any:  # noqa: ANN401 - what the reader makes of it
    return read_file(path, read, _ORIGIN)


def _require(path: Path, parts: Mapping[str, bool | str]) -> None:
    require_parts(path, parts, _ORIGIN)


def _is_number(value: object) -> bool:
    """Whether it is a finite number, and none that is too large for a float."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_method(value: object) -> bool:
    """Whether it is what an `Entrant` is made of; an interpolation would be filled in where it is opened."""
    return (
        isinstance(value, dict)
        and set(value) == {"filter", "adaptation", "r_scale"}
        and all(isinstance(own, dict) for own in value.values())
        and all(is_text(value[kind].get("name")) for kind in value if kind != "r_scale")
        and is_mapping_of(_is_number)(value["r_scale"])
        and "${" not in json.dumps(value)
    )


def _is_of_score(value: object) -> bool:
    return value is None or is_text(value) or isinstance(value, float) or _is_number(value)


FACTS: Mapping[str, tuple[Test, str]] = {
    "entry": (is_text, "the name of the entry"),
    "suite": (is_text, "the name of its suite"),
    "protocol": (is_text, "a digest"),
    "data": (lambda value: isinstance(value, list) and all(map(is_text, value)), "a list of digests"),
    "method": (_is_method, "filter and adaptation with name and plain values, and r_scale with numbers"),
    "tuned": (lambda value: isinstance(value, bool), "true or false"),
    "score": (is_mapping_of(_is_of_score), "numbers and words by their names"),
    "files": (is_mapping_of(is_text), "hashes by the names of the files"),
}
"""What a check reads of the manifest, with a test of its value and what it has to be."""

SETTINGS_SHAPE = (
    f"under 'entry' and 'plain' a number for each parameter of '{AS_GIVEN}'; if tuned, under '{TUNED_ON}' too"
)


def _are_settings(value: object) -> bool:
    """Whether both methods have the values of their knobs: as given, and tuned if they were tuned."""
    return (
        is_mapping_of(is_mapping_of(is_mapping_of(_is_number)))(value)
        and isinstance(value, dict)
        and set(value) == {"entry", "plain"}
        and all(set(own) in ({AS_GIVEN}, {AS_GIVEN, TUNED_ON}) for own in value.values())
    )


# The way of a method into a suite: from its parts to its entry.


def enter(scale: str, entrant: Entrant, name: str, place: Site, command: str) -> str:
    """Tune and score an entrant, and write its entry to the folder of ``place``; returns its page.

    Runs that are stored there are not done again; those of the plain filter are kept in the cache, for every entry.

    Args:
        scale: name of the suite.
        entrant: the method.
        name: what the board calls it.
        place: where.
        command: what was typed.

    Raises:
        JerkbenchError: it cannot be made or does not fit, or the suite is not the frozen one.
    """
    protocol = read_suite(scale)
    campaign = SuiteCampaign(entrant, protocol, replace(place, folder=place.folder / "runs"), name)
    require_recordings(scale, protocol)
    kept_for_every_entry = replace(place, folder=cache_folder("suite") / f"{protocol.name}-rows")
    levels, plain = scored_plain(protocol, kept_for_every_entry)
    scored = campaign.scored(levels)
    both = {ENTRY: scored, PLAIN: plain}
    rows = pd.concat([own.rows.assign(method=method) for method, own in both.items()], ignore_index=True)
    page = EntryScoring(protocol).page(name, rows)
    manifest = {
        "entry": name,
        **frozen_part(scale, protocol),
        "method": entrant.parts,
        "tuned": bool(campaign.space.knobs),
        "command": command,
        "code": code_digest(),
        "plugins": plugins_digest(entrant, protocol),
        "git_commit": git_commit(),
        "versions": versions(),
        "score": score_as_json(rows, protocol),
    }
    write_entry(place.folder, manifest, rows, {method: own.settings for method, own in both.items()}, page)
    return page


def frozen_part(scale: str, protocol: SuiteProtocol) -> dict[str, object]:
    """Return what the manifest of each entry of a suite has to say."""
    return {"suite": scale, "protocol": protocol.digest, "data": [FROZEN[scale].data]}
