"""The folder of an entry: rows, settings, what it was made with, and its score."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import yaml

from jerkbench.errors import JerkbenchError
from jerkbench.files import write_atomically, write_text
from jerkbench.suite.entrant import Entrant
from jerkbench.suite.scores import Score
from jerkbench.tuning.space import Setting

ROWS, SETTINGS, PAGE, MANIFEST = "rows.parquet", "settings.yaml", "entry.md", "manifest.json"
HASHED = (ROWS, SETTINGS, PAGE)
"""Files whose hashes stand in the manifest."""

COLUMNS = ("method", "tuned_on", "scenario", "seed", "status", "reason", "position_rmse_m", "anees", "seconds")
"""Of the rows."""

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

    def setting(self, method: str, tuned_on: str) -> Setting:
        """Return the values of the knobs, in order."""
        return tuple(float(value) for value in self.settings[method][tuned_on].values())


def write_entry(folder: Path, manifest: Mapping[str, Any], rows: pd.DataFrame, settings: Settings, page: str) -> None:
    """Write an entry; the manifest, without which there is none, comes last.

    Raises:
        OSError: it cannot be written.
    """
    kept = rows[list(COLUMNS)]
    write_atomically(folder / ROWS, lambda path: kept.to_parquet(path, index=False))
    write_text(folder / SETTINGS, yaml.safe_dump(settings, sort_keys=False))
    write_text(folder / PAGE, page)
    whole = {**manifest, "files": file_hashes(folder)}
    write_text(folder / MANIFEST, json.dumps(whole, indent=1) + "\n")


def read_entry(folder: Path) -> Entry:
    """Read an entry.

    Raises:
        JerkbenchError: a part of it is missing or damaged; says which.
    """
    for name in (MANIFEST, *HASHED):  # a pipe would be waited for
        if (folder / name).exists() and not (folder / name).is_file():
            raise JerkbenchError(f"{folder / name} is no file. An entry is made by `jerkbench suite run`.")
    manifest = _read(folder / MANIFEST, lambda path: json.loads(path.read_text(encoding="utf-8")))
    settings = _read(folder / SETTINGS, lambda path: yaml.safe_load(path.read_text(encoding="utf-8")))
    return Entry(folder, manifest, _read(folder / ROWS, pd.read_parquet), settings)


def _read(path: Path, read: Any) -> Any:  # noqa: ANN401 - what the reader makes of it
    try:
        return read(path)
    except (OSError, ValueError, pa.ArrowException, yaml.YAMLError) as error:
        reason = "it is not there" if not path.exists() else str(error).splitlines()[0].rstrip(".")
        raise JerkbenchError(f"{path} cannot be read: {reason}. An entry is made by `jerkbench suite run`.") from error


def file_hashes(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of an entry but its manifest.

    Raises:
        OSError: one cannot be read.
    """
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in HASHED}


def plain_score(score: Score) -> dict[str, Any]:
    """Return a score as JSON has it: what has no value is null."""
    return {key: None if isinstance(v, float) and math.isnan(v) else v for key, v in asdict(score).items()}
