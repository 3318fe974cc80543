"""Damaged and forged suite entries as input of `suite verify` and `suite board`, which should not print a traceback.

    python benchmarks/hostile_entries.py [DAMAGES]

Each damage is applied to a new copy of a small entry. An undamaged entry in the same folder must remain on the board.
"""

import hashlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from hostile_results import Rng, answered, changed_somewhere

from jerkbench.campaign.entry import ENTRY_FILE, HASHED, PAGE, ROWS_FILE, SETTINGS

PATIENCE_S = 60
"""A command that takes longer counts as hung."""

CONTENTS = (
    b"",
    b"[]",
    b"null",
    b"{}",
    b"3",
    b"\xff\xfe",
    b"PAR1",
    b"[" * 100_000,
    b"9" * 10_000,
    b"a: &a [*a]",
    b"- {",
)
"""Contents that replace the content of a file."""

VALUES = (-1.0, 0.0, 1e308, 1e-308, float("inf"), -float("inf"), float("nan"), 3, True, "x", b"\xff", -1, 2**62)
"""Values that replace the values of rows."""


class HangError(Exception):
    """A command took too long."""


def flipped_bytes(path: Path, rng: Rng) -> str:
    """Change a few bytes."""
    content = bytearray(path.read_bytes())
    for place in rng.integers(len(content), size=rng.integers(1, 4)):
        content[place] = rng.integers(256)
    path.write_bytes(content)
    return "flipped bytes"


def cut(path: Path, rng: Rng) -> str:
    """Truncate a file."""
    content = path.read_bytes()
    path.write_bytes(content[: rng.integers(len(content))])
    return "cut"


def other_content(path: Path, rng: Rng) -> str:
    """Replace the content of a file."""
    content = CONTENTS[rng.integers(len(CONTENTS))]
    path.write_bytes(content)
    return f"is {content[:20]!r}"


def no_file(path: Path, rng: Rng) -> str:
    """Delete a file, or replace it with a folder, a link or a pipe."""
    path.unlink()
    kinds: dict[str, Callable[[], object]] = {
        "gone": lambda: None,
        "folder": path.mkdir,
        "link": lambda: path.symlink_to("nowhere"),
        "loop": lambda: path.symlink_to(path.name),
        "pipe": lambda: os.mkfifo(path),
    }
    kind = list(kinds)[rng.integers(len(kinds))]
    kinds[kind]()
    return kind


def forged(path: Path, rng: Rng) -> str:
    """Change or delete one value at any depth, or one column of the rows, or add text to the page."""
    if path.name == ROWS_FILE:
        table = pq.read_table(path)
        table, what = forged_column(table, table.column_names[rng.integers(table.num_columns)], rng)
        pq.write_table(table, path)
    elif path.name == PAGE:
        path.write_text(path.read_text() + "\x1b[2J better", encoding="utf-8")
        what = "a line more"
    else:
        is_json = path.name == ENTRY_FILE
        content, what = changed_somewhere((json.loads if is_json else yaml.safe_load)(path.read_text()), rng)
        path.write_text(json.dumps(content) if is_json else yaml.safe_dump(content), encoding="utf-8")
    return f"forged: {what}"


def forged_column(table: pa.Table, name: str, rng: Rng) -> tuple[pa.Table, str]:
    """Return the rows with one changed column, and a description of the change."""
    place, rows = table.column_names.index(name), table.num_rows
    columns: dict[str, Callable[[], pa.Table]] = {
        "dropped": lambda: table.drop([name]),
        "renamed": lambda: table.rename_columns([f"\x1b{n}" if n == name else n for n in table.column_names]),
        "twice": lambda: table.append_column(name, table[name]),
        "no rows": lambda: table.slice(0, 0),
        "rows twice": lambda: pa.concat_tables([table, table]),
        "nulls": lambda: table.set_column(place, name, pa.nulls(rows, table[name].type)),
        "lists": lambda: table.set_column(place, name, pa.array([[1.0]] * rows)),
    }
    for value in VALUES:
        columns[f"all {value!r}"] = lambda value=value: table.set_column(place, name, pa.array([value] * rows))
        columns[f"one {value!r}"] = lambda value=value: with_one(table, place, value)
    what = list(columns)[rng.integers(len(columns))]
    return columns[what](), what


def with_one(table: pa.Table, place: int, value: object) -> pa.Table:
    """Return the rows with one changed value."""
    values = table.column(place).to_pylist()
    values[0] = value
    try:
        return table.set_column(place, table.column_names[place], pa.array(values))
    except (pa.ArrowInvalid, pa.ArrowTypeError):  # a column cannot have mixed types
        return table.set_column(place, table.column_names[place], pa.array([value] * len(values)))


def signed(path: Path, rng: Rng) -> str:
    """Forge a file, and update the hashes in the manifest."""
    what = forged(path, rng)
    manifest = path.parent / ENTRY_FILE
    content = json.loads(manifest.read_text())
    if isinstance(content, dict):
        hashes = {name: hashlib.sha256((path.parent / name).read_bytes()).hexdigest() for name in HASHED}
        manifest.write_text(json.dumps(content | {"files": hashes}), encoding="utf-8")
    return f"{what}, signed"


KINDS = (flipped_bytes, cut, other_content, no_file, forged, signed)
FILES = (ENTRY_FILE, SETTINGS, ROWS_FILE, ENTRY_FILE, SETTINGS, ROWS_FILE, PAGE)
"""The page is damaged half as often as the other files, because no command reads it."""


def damage(entry: Path, number: int, rng: Rng) -> str:
    """Apply the damage with this number to a file of the entry, and return a description."""
    name = FILES[number // len(KINDS) % len(FILES)]
    return f"{name} {KINDS[number % len(KINDS)](entry / name, rng)}"


def surroundings(made: Path, folder: Path) -> Path:
    """Copy an entry twice into an empty folder, and return the folder of the copy that will be damaged."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("damaged", "whole"):
        shutil.copytree(made, folder / name, ignore=shutil.ignore_patterns("runs"))
    return folder / "damaged"


def words_for(entry: Path) -> dict[str, list[str]]:
    """Return the command lines that read an entry, by command."""
    return {
        "verify": ["suite", "verify", str(entry), "--rows", "3"],
        "board": ["suite", "board", str(entry.parent), "--rows", "0"],
    }


def hang(_signal: int, _frame: FrameType | None) -> None:
    """Raise `HangError`. This function is the handler of SIGALRM."""
    raise HangError(f"no answer within {PATIENCE_S} s")


def attack(damages: int, place: Path) -> None:
    """Apply ``damages`` damages, and print the endings of each command."""
    os.chdir(place)
    answered(["suite", "run", "filter=baseline", "adaptation=chi2", "--scale", "v2-tiny", "--workers", "1"])
    signal.signal(signal.SIGALRM, hang)
    counts: dict[str, Counter[str]] = {}
    longest, rng = 0.0, np.random.default_rng(1)
    for number in range(damages):
        entry = surroundings(place / "results/suite-v2-tiny/baseline-chi2", place / "entries")
        what = damage(entry, number, rng)
        for verb, words in words_for(entry).items():
            began = time.perf_counter()
            signal.alarm(PATIENCE_S)
            ending, printed = answered(words)
            signal.alarm(0)
            longest = max(longest, time.perf_counter() - began)
            counts.setdefault(verb, Counter())[ending] += 1
            if ":" in ending or ending == "?" or "\x1b" in printed or "Traceback" in printed:
                print(f"{verb} after {what}: {ending}", flush=True)
            if verb == "board" and ending != "survived":
                print(f"no board after {what}: {printed[:300]}", flush=True)
    for verb, endings in counts.items():
        print(f"{verb}: {', '.join(f'{count} {ending}' for ending, count in endings.most_common())}")
    print(f"longest command: {longest:.1f} s")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        attack(int(sys.argv[1]) if len(sys.argv) > 1 else 174, Path(folder))
