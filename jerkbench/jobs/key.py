"""The key of a cell: a hash of all that its rows depend on but their seeds: our code, the plugins', the data."""

import hashlib
import json
import os
import platform
import secrets
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import packages_distributions, version
from pathlib import Path
from typing import Any

from jerkbench.contracts import Dataset, Disturbance, ReadingFile
from jerkbench.errors import PluginError, RecordingError

# The provenance of a result, besides its configuration: our own code, the plugins' code, the
# libraries.

PACKAGE_FOLDER = Path(__file__).parents[1]
KEY_LIBRARIES = ("filterpy", "numba", "numpy", "scipy", "pandas", "pymap3d", "hydra-core")
COMPUTING = (
    *("adaptation", "attitude", "compilation", "datasets", "disturbances", "engines"),
    *("filters", "inertial", "io", "kinematic", "recording", "simulation", "timeline"),
    *("contracts", "evaluation/metrics", "arrays", "estimate", "geometry", "kalman", "adapted_updates", "r_scale"),
    *("random_streams", "renamed", "campaign/split"),
    *("jobs/inputs", "jobs/job", "jobs/rows", "report/labels"),
    *(f"evaluation/{name}" for name in ("counted_rows", "evaluated_run", "correlated_errors")),
)
"""Rooms and modules of this package that the rows of a cell depend on: their code is in every key."""


@cache
def code_digest(*further: str) -> str:
    """Return the hash of the source files that rows depend on, of all traces, and of ``further`` packages."""
    digest = hashlib.sha256()
    for path in sorted([*PACKAGE_FOLDER.rglob("*.py"), *PACKAGE_FOLDER.glob("simulation/shipped/*.parquet")]):
        inside = path.relative_to(PACKAGE_FOLDER)
        if not {one.as_posix() for one in (inside.with_suffix(""), *inside.parents)}.isdisjoint((*COMPUTING, *further)):
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
    """Return the kind of processor that computes here: its family, and its instructions for arithmetic."""
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


# The code of a plugin that is not part of this package: the version and the files of its package, or the file of its
# module, and whatever it names in `depends_on`. `code_digest` covers our own plugins.

KNOWN_MODULES = {"jerkbench", "numpy", "scipy", "numba", "pandas", "filterpy", "pymap3d", "hydra", "omegaconf"}
"""Modules whose version or code is in every key."""

MAX_HASHED_BYTES = 64_000_000
"""A larger file is represented by its size and the time of its last change."""


@cache
def plugin_digest(cls: type) -> str:
    """Hash the code of a plugin from another package and of its base classes. Empty for our own plugins.

    A class without a file, defined in an interactive session, has a different digest in each process, because nothing
    tells whether it has changed.
    """
    bases = [base for base in cls.__mro__ if _top(base) not in KNOWN_MODULES | sys.stdlib_module_names]
    named = [line for base in cls.__mro__ for line in _named(base)]
    try:
        lines = [
            *(line for module in sorted({base.__module__ for base in bases}) for line in _module_lines(module)),
            *named,
        ]
    except LookupError:
        return _this_process()
    return _hash("\n".join(lines)) if lines else ""


def _top(cls: type) -> str:
    return cls.__module__.partition(".")[0]


@cache
def _this_process() -> str:
    return secrets.token_hex(32)


def _module_lines(module: str) -> Iterator[str]:
    """Yield a line for the version of the distribution of a module, and for each file of its package.

    Raises:
        LookupError: it has no file.
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


@cache
def _distributions() -> Mapping[str, list[str]]:
    return packages_distributions()


def _named(cls: type) -> Iterator[str]:
    """Yield a line for each entry of `depends_on`. Paths start at the folder of the module."""
    names = vars(cls).get("depends_on", ())
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise PluginError(f'{cls.__name__}.depends_on is {names!r}; give a tuple of texts, such as ("gains.csv",).')
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    return named_digests(names, Path(file).parent if file else Path())


def named_digests(names: Iterable[str], home: Path) -> Iterator[str]:
    """Yield a line for each of ``names``: a file or folder relative to ``home``, or $NAME, a variable."""
    for name in names:
        path = home / name
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
