"""Damaged results of a study as input of every command. No command should print a traceback.

    python benchmarks/hostile_results.py [DAMAGES]

Each damage is applied to a new copy of a small study. Then each command runs in this process.
"""

import contextlib
import io
import json
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.cli import main
from jerkbench.errors import NOT_COMPARABLE
from jerkbench.jobs.store import REQUIRED_COLUMNS, content_of, part_name

Rng = np.random.Generator
STRANGE = (
    None, True, 3, -1, 0, 10**30, 1e308, float("nan"), float("inf"), "", "x",
    "\x1b[2J", '"><img src=x onerror=alert(1)>',
    [], [1], ["x"], {}, {"cells": 3}, {"name": "nobody"}, [[[]]],
)  # fmt: skip
"""Values that are invalid in most places."""
NAMES = ('"><img src=x onerror=alert(1)>.parquet', "\x1b[2J.parquet", "x.parquet", "é.parquet", "-.parquet", ".parquet")
"""File names that are not a valid key."""


def damage(study: Path, rng: Rng) -> str:
    """Apply one random damage to the folder, and return a description."""
    act = ATTACKS[rng.integers(len(ATTACKS))]
    return f"{act.__name__} {act(study, rng)}"


def chosen(study: Path, rng: Rng) -> Path:
    """Return a random file with results."""
    cells = sorted((study / "cells").iterdir())
    return cells[rng.integers(len(cells))]


def any_file(study: Path, rng: Rng) -> Path:
    """Return the manifest or a random file with results."""
    return study / "manifest.json" if rng.uniform() < 0.5 else chosen(study, rng)


def flipped_bytes(study: Path, rng: Rng) -> str:
    """Change a few bytes."""
    path = any_file(study, rng)
    content = bytearray(path.read_bytes())
    for place in rng.integers(len(content), size=rng.integers(1, 4)):
        content[place] = rng.integers(256)
    path.write_bytes(content)
    return path.name


def cut(study: Path, rng: Rng) -> str:
    """Truncate a file."""
    path = any_file(study, rng)
    content = path.read_bytes()
    path.write_bytes(content[: rng.integers(len(content))])
    return path.name


def other_content(study: Path, rng: Rng) -> str:
    """Replace the content of a file."""
    path = any_file(study, rng)
    choices = (
        b"",
        b"[]",
        b"null",
        b'{"cells": 3}',
        b"\xff\xfe",
        b"PAR1",
        b"[" * 100_000,
        b"9" * 10_000,
        b'{"cells": [1]}',
    )
    content = choices[rng.integers(len(choices))]
    path.write_bytes(content)
    return f"{path.name} {content[:20]!r}"


def no_file(study: Path, rng: Rng) -> str:
    """Delete a file, or replace it with a folder, a link or a pipe."""
    path = any_file(study, rng)
    path.unlink()
    kinds: dict[str, Callable[[], Any]] = {
        "gone": lambda: None,
        "folder": path.mkdir,
        "link": lambda: path.symlink_to("nowhere"),
        "loop": lambda: path.symlink_to(path.name),
        "pipe": lambda: os.mkfifo(path),
    }
    kind = list(kinds)[rng.integers(len(kinds))]
    kinds[kind]()
    return f"{path.name} {kind}"


def renamed(study: Path, rng: Rng) -> str:
    """Rename or copy a file with results to a name that is not a valid key."""
    path, name = chosen(study, rng), NAMES[rng.integers(len(NAMES))]
    (path.rename if rng.uniform() < 0.5 else lambda to: shutil.copy(path, to))(path.with_name(name))
    return f"{path.name} {name!r}"


def copied(study: Path, rng: Rng) -> str:
    """Copy a file with results to another key."""
    path = chosen(study, rng)
    shutil.copy(path, path.with_name("abc.parquet"))
    return path.name


def changed_manifest(study: Path, rng: Rng) -> str:
    """Change a random value in the manifest."""
    path = study / "manifest.json"
    content, what = changed_somewhere(json.loads(path.read_text()), rng)
    path.write_text(json.dumps(content))
    return what


def dropped_column(study: Path, rng: Rng) -> str:
    """Delete a required column, and update the digest of the file."""
    path, name = chosen(study, rng), sorted(REQUIRED_COLUMNS)[rng.integers(len(REQUIRED_COLUMNS))]
    sign(path, pq.read_table(path).drop([name]))
    return name


def sign(path: Path, table: pa.Table) -> Path:
    """Replace a file with the table under the correct digest, and return the new path."""
    content = content_of(table)
    path.unlink()
    signed = path.with_name(f"{part_name(content)}.parquet")
    signed.write_bytes(content)
    return signed


def changed_somewhere(content: Any, rng: Rng) -> tuple[Any, str]:  # noqa: ANN401 - any JSON
    """Return the content with one replaced or deleted value at a random depth, and a description."""
    keys = list(content) if isinstance(content, dict) else range(len(content)) if isinstance(content, list) else []
    if not keys or rng.uniform() < 0.1:
        value = STRANGE[rng.integers(len(STRANGE))]
        return value, f"= {value!r}"
    key = list(keys)[rng.integers(len(keys))]
    if rng.uniform() < 0.2:
        if isinstance(content, dict):
            return {name: value for name, value in content.items() if name != key}, f"{key} deleted"
        return [*content[:key], *content[key + 1 :]], f"{key} deleted"
    inner, what = changed_somewhere(content[key], rng)
    changed = {**content, key: inner} if isinstance(content, dict) else [*content[:key], inner, *content[key + 1 :]]
    return changed, f"{key}.{what}"


ATTACKS = (
    flipped_bytes, cut, other_content, no_file, renamed, copied,
    changed_manifest, dropped_column,
)  # fmt: skip


def words_for(study: Path, whole: Path) -> dict[str, list[str]]:
    """Return the command lines that read a study, by command.

    Args:
        study: folder of the study.
        whole: folder of the undamaged study for `jerkbench compare`.
    """
    folder = str(study)
    return {
        "table": ["table", folder],
        "table csv": ["table", folder, "--format", "csv"],
        "table html": ["table", folder, "--format", "html", "--baseline", "adaptation=none"],
        "table findings": ["table", folder, "--findings"],
        "compare": ["compare", folder, str(whole)],
        "compare back": ["compare", str(whole), folder, "--fail-above", "1"],
        "rerun": ["rerun", folder, "1"],
        "export": ["export", folder, "2", "--tum", str(study / "tum")],
        "report": ["report", folder, "--scenarios", "0"],
        "figures": ["figures", folder, "--scenarios", "0"],
    }


SWEEP = (
    "filter=baseline",
    "adaptation=none,mtf",
    "dataset.duration_s=8",
    "seeds=2",
    "metrics=[position_rmse,consistency]",
)
QUIET = ("figures=false", "workers=1", "study=small")


ENDINGS = {0: "survived", 1: "difference", 2: "refused", 3: "worse", NOT_COMPARABLE: "not comparable"}
"""Descriptions of the exit codes."""


def answered(words: list[str]) -> tuple[str, str]:
    """Run a command line in this process, and return its ending and its output."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            main(words)
        except SystemExit as ended:
            return ENDINGS.get(int(ended.code or 0), "?"), printed.getvalue()
        except Exception as error:  # noqa: BLE001 - any exception is a fault
            return f"{type(error).__name__}: {error}", printed.getvalue()
    return "survived", printed.getvalue()


def attack(damages: int, place: Path) -> None:
    """Apply ``damages`` damages, and print the endings of each command."""
    study = place / "results" / "small"
    os.chdir(place)
    answered(["run", "-m", *SWEEP, *QUIET])
    counts: dict[str, Counter[str]] = {}
    longest = 0.0
    rng = np.random.default_rng(1)
    for _ in range(damages):
        copy = place / "damaged"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(study, copy)
        what = damage(copy, rng)
        for verb, words in words_for(copy, study).items():
            began = time.perf_counter()
            ending, printed = answered(words)
            longest = max(longest, time.perf_counter() - began)
            counts.setdefault(verb, Counter())[ending] += 1
            if ":" in ending or "\x1b" in printed or "Traceback" in printed:
                print(f"{verb} after {what}: {ending}", flush=True)
    for verb, endings in counts.items():
        print(f"{verb}: {', '.join(f'{count} {ending}' for ending, count in endings.most_common())}")
    print(f"longest command: {longest:.1f} s")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        attack(int(sys.argv[1]) if len(sys.argv) > 1 else 200, Path(folder))
