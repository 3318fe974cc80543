"""The key of a job, and the manifest of a study, which record the code and its versions.

The key is a hash of the configuration, the code and the data. The seeds are not part of the key. The manifest is a file
with the jobs, the command, the code version and the machine of a study.
"""

import hashlib
import json
import os
import platform
import secrets
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import entry_points, packages_distributions, version
from pathlib import Path
from typing import Any

from jerkbench.contracts import Dataset, Disturbance, ReadingFile
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import KINDS

PACKAGE_FOLDER = Path(__file__).parents[1]
KEY_LIBRARIES = ("filterpy", "numba", "numpy", "scipy", "pandas", "pymap3d", "hydra-core")
COMPUTING = (
    *("adaptation", "attitude", "compilation", "datasets", "disturbances", "engines"),
    *("filters", "inertial", "io", "kinematic", "recording", "simulation", "timeline"),
    *("contracts", "evaluation/metrics", "arrays", "estimate", "geometry", "kalman", "numpy_run"),
    *("parameters", "random_streams", "renamed", "campaign/split"),
    *("jobs/job", "jobs/rows", "report/labels"),
    *(f"evaluation/{name}" for name in ("counted_rows", "evaluated_run", "correlated_errors")),
)
"""Packages and modules that the rows depend on. The code of these modules is part of every key."""


@cache
def code_digest(*further: str) -> str:
    """Return a hash of the source files in `COMPUTING` and ``further``, and of the receiver traces of this package."""
    digest = hashlib.sha256()
    for path in sorted([*PACKAGE_FOLDER.rglob("*.py"), *PACKAGE_FOLDER.glob("simulation/shipped/*.parquet")]):
        inside = path.relative_to(PACKAGE_FOLDER)
        if not {one.as_posix() for one in (inside.with_suffix(""), *inside.parents)}.isdisjoint((*COMPUTING, *further)):
            digest.update(str(inside).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python, this package and the libraries that affect results."""
    return {"python": platform.python_version(), **{name: version(name) for name in ("jerkbench", *KEY_LIBRARIES)}}


@cache
def plugin_packages() -> dict[str, str]:
    """Return the names and versions of the installed packages with plugins, except this package."""
    distributions = {entry.dist for kind in KINDS for entry in entry_points(group=f"jerkbench.{kind}") if entry.dist}
    return {one.name: one.version for one in sorted(distributions, key=lambda one: one.name)}


ARITHMETIC = ("amx", "avx", "fma", "neon", "sse", "sve")
"""Prefixes of the names of instruction sets that affect rounding errors."""


@cache
def processor_kind() -> str:
    """Return text with the processor model and its arithmetic instruction sets, which affect rounding errors."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    names = sorted(name for name, present in features.items() if present and name.startswith(ARITHMETIC))
    return f"{binding.get_host_cpu_name()}: {' '.join(names)}"


OF_CODE = ("--", ":/", ":(top,exclude)results")
"""Paths for `git status`. The folder `results` is excluded, because runs change it."""


@cache
def git_commit() -> str:
    """Return the git commit of this package, followed by "+changes" if files were changed, or "" outside a checkout."""

    def git(*options: str) -> str:
        command = ["git", "-C", str(PACKAGE_FOLDER), *options]
        result = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - fixed options
        return result.stdout.strip() if result.returncode == 0 else ""

    try:
        tracked = git("ls-files", "--", "__init__.py")
        commit = git("rev-parse", "HEAD") if tracked else ""
        return commit + ("+changes" if commit and git("status", "--porcelain", *OF_CODE) else "")
    except FileNotFoundError:  # git is not installed
        return ""


IDENTITY_DIGITS = 16
"""Number of digits of a key that depend on the configuration and the data. The other digits of a key depend on the
code."""


def key_of(identity: Mapping[str, Any], classes: Iterable[type]) -> str:
    """Return the hash of ``identity``, followed by a hash of the code of jerkbench, its libraries and the plugins."""
    code = [code_digest(), *versions().values(), *map(plugin_digest, classes)]
    return _hash(json.dumps(identity, sort_keys=True))[:IDENTITY_DIGITS] + _hash("\n".join(code))[:8]


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def data_fingerprint(dataset: Dataset, disturbances: Sequence[Disturbance]) -> str:
    """Return the fingerprint of the data set, followed by the fingerprints of the disturbances that read a file."""
    marks = [d.fingerprint() for d in disturbances if isinstance(d, ReadingFile)]
    return "+".join([dataset.fingerprint(), *filter(None, marks)])


def require_data(dataset: Dataset, disturbances: Sequence[Disturbance], fingerprint: str) -> None:
    """Check that the data of a data set and its disturbances still have the given fingerprint.

    Raises:
        RecordingError: The data have changed since the fingerprint was computed.
    """
    current = data_fingerprint(dataset, disturbances)
    if current != fingerprint:
        hashes = f"their hash was {fingerprint or 'empty'}, and is now {current or 'empty'}"
        data = f"The data of the data set {type(dataset).__name__}"
        raise RecordingError(f"{data} have changed: {hashes}. Run `jerkbench run` again to use the new data.")


# `plugin_digest` hashes the version and the files of the package of a plugin, and the files in its `depends_on`.
# The plugins of jerkbench are already hashed by `code_digest`.

KNOWN_MODULES = {"jerkbench", "numpy", "scipy", "numba", "pandas", "filterpy", "pymap3d", "hydra", "omegaconf"}
"""Packages that `plugin_digest` does not hash, because `key_of` already includes their version or code."""

MAX_HASHED_BYTES = 64_000_000
"""A larger file is represented in the digest by its size and the time of its last change."""


_THIS_PROCESS = secrets.token_hex(32)
"""The hash of plugins without a source file, which is different each time that jerkbench is started."""


@cache
def plugin_digest(cls: type) -> str:
    """Return a hash of the code of a plugin of another package and of its base classes.

    For a plugin of jerkbench without `depends_on`, the result is an empty string. The source of a class that was
    defined in an interactive session is not available. The hash of such a class is different in each process, so its
    runs are computed again.
    """
    known = KNOWN_MODULES | sys.stdlib_module_names
    bases = [base for base in cls.__mro__ if base.__module__.partition(".")[0] not in known]
    named = [line for base in cls.__mro__ for line in _named(base)]
    try:
        modules = sorted({base.__module__ for base in bases})
        lines = [*(line for module in modules for line in _module_lines(module)), *named]
    except LookupError:
        return _THIS_PROCESS
    return _hash("\n".join(lines)) if lines else ""


def _module_lines(module: str) -> Iterator[str]:
    """Yield text lines with the version of the distribution of a module, and with the hash of each of its files.

    Raises:
        LookupError: The module has no source file.
    """
    top = module.partition(".")[0]
    yield from (f"{name} {version(name)}" for name in sorted(set(_distributions().get(top, ()))))
    folders = [Path(folder) for folder in getattr(sys.modules.get(top), "__path__", ())]
    file = getattr(sys.modules.get(module), "__file__", None)
    if not folders and file is None:
        raise LookupError(module)
    for folder in folders:
        yield from (f"{path.relative_to(folder)} {_content(path)}" for path in _files_below(folder))
    if not folders:
        yield f"{module} {_content(Path(str(file)))}"


_distributions = cache(packages_distributions)


def _named(cls: type) -> Iterator[str]:
    """Yield a text line with the name and the content (hash or value) of each entry of `depends_on` of a class.

    An entry of `depends_on` is a path relative to the folder of the module, or an environment variable ($NAME).
    """
    names = vars(cls).get("depends_on", ())
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise PluginError(f'{cls.__name__}.depends_on is {names!r}; give a tuple of strings, such as ("gains.csv",).')
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    for name in names:
        path = (Path(file).parent if file else Path()) / name
        if name.startswith("$"):
            yield f"{name} {os.environ.get(name[1:])!r}"
        elif path.is_dir():
            yield from (f"{name} {inside.relative_to(path)} {_content(inside)}" for inside in _files_below(path))
        else:
            yield f"{name} {_content(path) if path.is_file() else 'missing'}"


def _files_below(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).parts
        if path.is_file() and not any(part == "__pycache__" or part.startswith(".") for part in inside):
            yield path


def _content(path: Path) -> str:
    stat = path.stat()
    if stat.st_size > MAX_HASHED_BYTES:
        return f"{stat.st_size} {stat.st_mtime_ns}"
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# The manifest of a study.

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

    from jerkbench.files import write_text

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
