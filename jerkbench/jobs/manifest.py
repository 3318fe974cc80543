"""The manifest of a study: what was run, by which code, on which machine."""

import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jerkbench.files import exists, write_text
from jerkbench.jobs.key import git_commit, versions

MANIFEST = "manifest.json"


def write_manifest(
    folder: Path,
    seeds: Mapping[str, Sequence[int]],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None = None,
) -> None:
    """Write what was run, by which code, on which machine; the order and the notes of earlier cells are kept.

    Of two processes in one folder each adds to what the other has written. ``seeds`` of each cell are shown from now
    on; those of a cell that is not whole are empty. Where seeds were added in blocks, ``level`` is what the last look
    may spend.
    """
    from filelock import FileLock

    keys = list(seeds)
    with FileLock(folder / ".manifest.lock"):
        before = read_manifest(folder)
        shown, notes_of, levels = (before.get(name, {}) for name in ("seeds", "notes", "levels"))
        manifest = {
            "cells": list(dict.fromkeys([*before.get("cells", []), *keys])),
            "last": keys,
            "seeds": {**shown, **{key: _with(shown.get(key, ()), stretches(own)) for key, own in seeds.items() if own}},
            "notes": {**notes_of, **{key: list(notes) for key in keys}},
            "levels": {**levels, **(dict.fromkeys(keys, level) if level is not None else {})},
            "command": list(command),
            "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "versions": versions(),
            "commit": git_commit(),
            "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
        }
        write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def stretches(seeds: Sequence[int]) -> list[list[int]]:
    """Return seeds that follow each other as the first, and how many: [0, 1, 2, 7] is [[0, 3], [7, 1]]."""
    found: list[list[int]] = []
    for seed in sorted(seeds):
        if found and seed == sum(found[-1]):
            found[-1][1] += 1
        else:
            found.append([seed, 1])
    return found


def _with(before: Iterable[Sequence[int]], own: list[list[int]]) -> list[list[int]]:
    """Add seeds to those that are shown: what has none of them stays, as the shards of other processes."""
    apart = [[*old] for old in before if not any(old[0] < sum(new) and new[0] < sum(old) for new in own)]
    return sorted([*apart, *own])


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest; empty where there is none yet."""
    path = folder / MANIFEST
    if not exists(path):
        return {}
    try:
        if path.is_file():  # a pipe would be waited for
            manifest: Any = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(manifest, dict) and all(_is_entry(name, value) for name, value in manifest.items()):
                return manifest
    except FileNotFoundError:
        return {}
    except (ValueError, RecursionError):  # no text, or no JSON
        pass
    print(f"{path} is damaged and left aside; `jerkbench run` makes it anew.", file=sys.stderr)
    return {}


def _is_entry(name: str, value: object) -> bool:
    """Whether an entry is what a manifest has: no hash says whether the file was damaged."""
    if name in MAPPINGS:
        return isinstance(value, dict) and all(map(MAPPINGS[name], value.values()))
    return name not in LISTS or _are_texts(value)


def _are_texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


def _are_stretches(value: object) -> bool:
    pairs = value if isinstance(value, list) else [None]
    return all(isinstance(pair, list) and len(pair) == 2 and all(type(n) is int for n in pair) for pair in pairs)


LISTS = ("cells", "last", "command")
MAPPINGS: Mapping[str, Callable[[object], bool]] = {
    "seeds": _are_stretches,
    "notes": _are_texts,
    "levels": lambda value: isinstance(value, int | float),
    "versions": lambda value: isinstance(value, str),
}
"""Entries of a manifest that are read again: lists of texts, and mappings with a test of their values."""
