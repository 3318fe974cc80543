"""The files of a store: listed, loaded, written atomically, replaced."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa

from jerkbench.errors import JerkbenchError
from jerkbench.files import exists
from jerkbench.results.parts import NAME, content_of, part_name, part_of

OLD = re.compile("[0-9a-f]{20}")
"""The name of a file with one cell, as it was stored before there were parts: its key."""

LISTINGS = 20
"""So often the files are listed again, where some of them have just been joined."""


class PartFiles:
    """The Parquet files in one folder, each by its name without the ending."""

    def __init__(self, folder: Path) -> None:
        """Take the folder as it is, there or not."""
        self.folder = folder

    def path(self, name: str) -> Path:
        """Return where the file of this name lies."""
        return self.folder / f"{name}.parquet"

    def names(self) -> list[str]:
        """Return the names of all files."""
        names = sorted(path.name.removesuffix(".parquet") for path in self.folder.glob("*.parquet"))
        _require_parts(self.folder, names)
        return names

    def each(
        self, keys: Sequence[str] | None, columns: list[str] | None = None
    ) -> Iterator[tuple[str, pa.Table | None]]:
        """Each file that may hold ``keys``, by its name, with its rows (default: whole); None where it is damaged."""
        seen: set[str] = set()
        wanted = None if keys is None else set(keys)
        for _ in range(LISTINGS):
            names = self.names()
            vanished = False
            for name in names:
                if name in seen or (wanted is not None and not NAME.fullmatch(name) and name not in wanted):
                    continue
                try:
                    yield name, self.load(name, columns)
                    seen.add(name)
                except FileNotFoundError:
                    vanished = True
            if not vanished:
                return

    def load(self, name: str, columns: list[str] | None) -> pa.Table | None:
        """Load a file, or some of its columns; None where it is not as it was written.

        Raises:
            FileNotFoundError: it is gone.
        """
        path = self.path(name)
        if not path.is_file():
            if exists(path):
                return None
            raise FileNotFoundError(path)
        try:
            content = path.read_bytes()
        except PermissionError as error:
            raise JerkbenchError(f"{path} cannot be read: {error.strerror}.") from error
        match = NAME.fullmatch(name)
        return part_of(content, match[1], columns) if match else None

    def put(self, table: pa.Table) -> Path:
        """Write rows as a new part, at once and whole; returns its path."""
        content = content_of(table)
        path = self.path(part_name(content))
        self.folder.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.stem}.{os.getpid()}.partial")
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        return path

    def replace(self, names: Sequence[str], table: pa.Table) -> Path:
        """Store rows of some parts as one, then delete these; a reader in between sees rows twice, never none."""
        path = self.put(table) if table.num_rows else self.folder
        for name in names:
            self.path(name).unlink(missing_ok=True)
        return path


def _require_parts(folder: Path, names: Sequence[str]) -> None:
    """Refuse cells in the format of before there were parts."""
    if old := next(filter(OLD.fullmatch, names), None):
        raise JerkbenchError(
            f"{folder / old}.parquet has a format of earlier versions, which is no longer read; run the study's command"
            " (it stands in manifest.json) again into a new one (study=NAME)."
        )
