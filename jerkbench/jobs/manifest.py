"""The manifest of a study: the jobs that were run, with which command, by which code and on which machine."""

import json
import os
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jerkbench.files import write_text
from jerkbench.jobs.key import git_commit, versions

MANIFEST = "manifest.json"

Stretches = Sequence[Sequence[int]]
"""Consecutive seeds, each as the first and their number."""
ShownSeeds = Mapping[str, Stretches]
"""The seeds that are shown, by the key of their job."""


def write_manifest(
    folder: Path,
    seeds: Mapping[str, Sequence[int]],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None = None,
) -> None:
    """Add the jobs of a command to the manifest. Other processes may write to the same manifest.

    Args:
        folder: of the study.
        seeds: the seeds of each job, which are shown from now on; empty for a job that is not complete.
        notes: of the configuration.
        command: the command line.
        level: significance level of the last interim analysis, if seeds were added in blocks.
    """
    from filelock import FileLock

    with FileLock(folder / ".manifest.lock"):
        before = read_manifest(folder)
        shown = before.get("seeds", {})
        manifest = {
            "cells": list(dict.fromkeys([*before.get("cells", []), *seeds])),
            "last": list(seeds),
            "seeds": shown | {key: _joined(shown.get(key, ()), stretches(own)) for key, own in seeds.items() if own},
            "notes": before.get("notes", {}) | {key: list(notes) for key in seeds},
            "levels": before.get("levels", {}) | ({} if level is None else dict.fromkeys(seeds, level)),
            "command": list(command),
            "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "versions": versions(),
            "commit": git_commit(),
            "host": {"system": platform.platform(), "machine": platform.machine(), "processors": os.cpu_count()},
        }
        write_text(folder / MANIFEST, json.dumps(manifest, indent=1))


def stretches(seeds: Sequence[int]) -> list[list[int]]:
    """Return consecutive seeds as the first and their number: [0, 1, 2, 7] is [[0, 3], [7, 1]]."""
    found: list[list[int]] = []
    for seed in sorted(seeds):
        if found and seed == sum(found[-1]):
            found[-1][1] += 1
        else:
            found.append([seed, 1])
    return found


def _joined(before: Stretches, own: list[list[int]]) -> list[list[int]]:
    """Add seeds to those that are shown already. New stretches replace the old ones that they overlap."""
    retained = [[*old] for old in before if not any(old[0] < sum(new) and new[0] < sum(old) for new in own)]
    return sorted([*retained, *own])


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest. It is empty if there is none."""
    path = folder / MANIFEST
    try:
        if not path.exists():
            return {}
        if path.is_file():  # reading a pipe would never end
            manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            if _is_valid(manifest):
                return manifest
    except FileNotFoundError:
        return {}
    except (ValueError, AttributeError, TypeError, RecursionError):  # it is not text, not JSON or not a manifest
        pass
    print(f"{path} is damaged and left aside; `jerkbench run` makes it anew.", file=sys.stderr)
    return {}


def _is_valid(manifest: Mapping[str, Any]) -> bool:
    """Whether the entries that are read have the right types."""

    def all_of(values: object, *kinds: type) -> bool:
        return all(isinstance(value, kinds) for value in values)  # type: ignore[attr-defined]  # or a TypeError

    lists = [manifest.get(name, []) for name in ("cells", "last", "command")] + [*manifest.get("notes", {}).values()]
    shown = [pair for own in manifest.get("seeds", {}).values() for pair in own]
    return (
        all_of(lists, list)
        and all(all_of(texts, str) for texts in lists)
        and all_of(manifest.get("levels", {}).values(), int, float)
        and all_of(manifest.get("versions", {}).values(), str)
        and all(len(pair) == 2 and all_of(pair, int) for pair in shown)
    )
