"""The key of a cell: a hash of all that its rows depend on but their seeds: our code, the plugins', the data."""

import hashlib
import json
import platform
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jerkbench.contracts import Dataset, Disturbance, ReadingFile
from jerkbench.errors import RecordingError
from jerkbench.jobs.sources import plugin_digest

# The provenance of a result, besides its configuration: our own code, the plugins' code, the
# libraries.

PACKAGE_FOLDER = Path(__file__).parents[1]
KEY_LIBRARIES = ("filterpy", "numba", "numpy", "scipy", "pandas", "pymap3d", "hydra-core")
COMPUTING = (
    *("adaptation", "attitude", "compilation", "datasets", "disturbances", "engines"),
    *("filters", "inertial", "io", "kinematic", "recording", "simulation", "measurements", "timeline"),
    *("contracts", "evaluation/metrics", "arrays", "estimate", "geometry", "kalman"),
    *("plugins/optional", "random_streams", "renamed", "sums", "tuning/splits"),
    *(f"jobs/{name}" for name in ("inputs", "job", "labels", "rows")),
    *(f"evaluation/{name}" for name in ("counted_rows", "evaluated_run", "correlated_errors")),
)
"""Rooms and modules of this package that the rows of a cell depend on: their code is in every key."""


@cache
def code_digest(*further: str) -> str:
    """Hash of every source file that the rows of a cell depend on, and of every trace.

    Args:
        further: rooms on which a result depends besides.
    """
    digest = hashlib.sha256()
    for path in sorted([*PACKAGE_FOLDER.rglob("*.py"), *PACKAGE_FOLDER.glob("simulation/shipped/*.parquet")]):
        inside = path.relative_to(PACKAGE_FOLDER)
        places = {part.as_posix() for part in (inside.with_suffix(""), *inside.parents)}
        if not places.isdisjoint((*COMPUTING, *further)):
            digest.update(str(inside).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def versions() -> dict[str, str]:
    """Versions of Python, this package and the libraries that compute."""
    return {"python": platform.python_version(), **{name: version(name) for name in ("jerkbench", *KEY_LIBRARIES)}}


ARITHMETIC = ("amx", "avx", "fma", "neon", "sse", "sve")
"""Beginnings of the names of instructions that decide in which order, and how often, sums are rounded."""


@cache
def processor_kind() -> str:
    """Return what machine code is made for here: the processor's family, and its instructions for arithmetic."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    names = sorted(name for name, present in features.items() if present and name.startswith(ARITHMETIC))
    return f"{binding.get_host_cpu_name()}: {' '.join(names)}"


OF_CODE = ("--", ":/", ":(top,exclude)results")
"""Where a change is one of the code: a run that writes results changes nothing that it depends on."""


@cache
def git_commit() -> str:
    """The commit of the checkout that the package runs from, with "+changes" if it has any; empty outside one."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(PACKAGE_FOLDER), *words], capture_output=True, text=True, check=False)  # noqa: S603, S607 - fixed words
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        tracked = git("ls-files", "--", "__init__.py")
        commit = git("rev-parse", "HEAD") if tracked else ""
        return commit + ("+changes" if commit and git("status", "--porcelain", *OF_CODE) else "")
    except FileNotFoundError:  # no git on this machine
        return ""


WHAT = 16
"""So many digits of a key say what is run; the others, by which code."""


def key_of(what: Mapping[str, Any], classes: Iterable[type]) -> str:
    """Hash what is run, then the code that runs it: ours, the libraries and the plugins'."""
    code = [code_digest(), *versions().values(), *map(plugin_digest, classes)]
    return _hash(json.dumps(what, sort_keys=True))[:WHAT] + _hash("\n".join(code))[:8]


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


# The identity of a scenario's data: those of its data set, and files that its disturbances read.


def data_fingerprint(dataset: Dataset, disturbances: Sequence[Disturbance]) -> str:
    """Return the fingerprint of the data set, and that of each disturbance that reads a file after it."""
    marks = [d.fingerprint() for d in disturbances if isinstance(d, ReadingFile)]
    return "+".join([dataset.fingerprint(), *filter(None, marks)])


def require_data(dataset: Dataset, disturbances: Sequence[Disturbance], fingerprint: str) -> None:
    """Require that the data are still those of ``fingerprint``.

    Raises:
        RecordingError: they are others.
    """
    current = data_fingerprint(dataset, disturbances)
    if current != fingerprint:
        raise RecordingError(
            f"The data of the data set {type(dataset).__name__} have changed since they were hashed: the hash was "
            f"{fingerprint or 'empty'}, it is {current or 'empty'}. `jerkbench run` with the same words runs it with "
            "the data that are there now."
        )
