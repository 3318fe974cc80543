"""The manifest of a study: what was run, by which code, on which machine."""

import json
import os
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from jerkbench.cells.provenance import git_commit, versions
from jerkbench.files import exists, read_text, write_text
from jerkbench.places import is_remote
from jerkbench.results.shape import is_manifest

MANIFEST = "manifest.json"


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
