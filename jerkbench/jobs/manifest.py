"""The manifest of a study: a file with the jobs, the command, the code version and the machine of the study."""

import json
import os
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from jerkbench.files import write_text
from jerkbench.jobs.key import git_commit, plugin_packages, versions

MANIFEST = "manifest.json"

Stretches = Sequence[Sequence[int]]
"""Blocks of consecutive seeds. Each block is the first seed and the number of seeds."""
JobSeeds = Mapping[str, Sequence[int]]
"""The seeds of each job by its key."""
ShownSeeds = Mapping[str, Stretches]
"""The blocks of seeds that tables show, by the key of the job."""


def write_manifest(
    folder: Path, seeds: JobSeeds, notes: Sequence[str], command: Sequence[str], level: float | None = None
) -> None:
    """Add the jobs of a command to the manifest of a study.

    Several processes may call this function for the same study.

    Args:
        folder: The folder of the study.
        seeds: The seeds of each job that tables show after this command, by the key of the job. For an incomplete job,
            the list of seeds is empty.
        notes: The notes that the configuration contains under the key ``notes``.
        command: The arguments of the command line.
        level: Significance level of the last interim analysis, or None if the number of seeds was fixed in advance.
    """
    from filelock import FileLock

    with FileLock(folder / ".manifest.lock"):
        before = read_manifest(folder)
        shown = before.get("seeds", {})
        manifest = {
            "cells": list(dict.fromkeys([*before.get("cells", []), *seeds])),
            "last": list(seeds),
            "seeds": shown | {key: _joined(shown.get(key, ()), stretches(d)) for key, d in seeds.items() if d},
            "notes": before.get("notes", {}) | {key: list(notes) for key in seeds},
            "levels": before.get("levels", {}) | ({} if level is None else dict.fromkeys(seeds, level)),
            "command": list(command),
            "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "versions": versions() | plugin_packages(),
            "commit": git_commit(),
            "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
        }
        write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def stretches(seeds: Sequence[int]) -> list[list[int]]:
    """Return [first seed, number of seeds] for each block of consecutive seeds: [[0, 3], [7, 1]] for [0, 1, 2, 7]."""
    found: list[list[int]] = []
    for seed in sorted(seeds):
        if found and seed == sum(found[-1]):
            found[-1][1] += 1
        else:
            found.append([seed, 1])
    return found


def _joined(before: Stretches, added: list[list[int]]) -> list[list[int]]:
    """Merge the lists of seed blocks ``before`` and ``added``.

    A block of ``added`` replaces all blocks of ``before`` that it overlaps.
    """
    retained = [[*old] for old in before if not any(old[0] < sum(new) and new[0] < sum(old) for new in added)]
    return sorted([*retained, *added])


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a study. A missing or damaged manifest is returned as an empty dictionary."""
    path = folder / MANIFEST
    with suppress(FileNotFoundError, ValueError, AttributeError, TypeError, RecursionError):
        if path.is_file():  # reading a pipe would never end
            manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            if _is_valid(manifest):
                return manifest
    if path.exists():
        print(f"{path} is damaged and ignored; `jerkbench run` writes the file again.", file=sys.stderr)
    return {}


def _is_valid(manifest: Mapping[str, Any]) -> bool:
    """Return whether the entries of a manifest have the required types."""

    def all_of(values: object, *kinds: type) -> bool:
        return all(isinstance(value, kinds) for value in values)  # type: ignore[attr-defined]  # may raise TypeError

    lists = [manifest.get(name, []) for name in ("cells", "last", "command")] + [*manifest.get("notes", {}).values()]
    shown = [pair for blocks in manifest.get("seeds", {}).values() for pair in blocks]
    return (
        all_of(lists, list)
        and all(all_of(texts, str) for texts in lists)
        and all_of(manifest.get("levels", {}).values(), int, float)
        and all_of(manifest.get("versions", {}).values(), str)
        and all(len(pair) == 2 and all_of(pair, int) for pair in shown)
    )
