"""The key of a job: a hash of the configuration, the code and the data. The seeds are not part of the key."""

import hashlib
import json
import os
import platform
import secrets
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
    *("jobs/inputs", "jobs/job", "jobs/rows", "report/labels"),
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
"""The hash of plugins without a source file, which is different in each process."""


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
