"""The key of a cell: a hash of all that its rows depend on but their seeds: our code, the plugins', the data."""

import ast
import hashlib
import json
import os
import platform
import secrets
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from jerkbench.contracts import Dataset, Disturbance, ReadingFile
from jerkbench.errors import PluginError, RecordingError

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


# The files and distributions that a plugin from elsewhere depends on, and a hash of them.
#
# Its own distribution, and whatever is installed so that it can be edited, counts by content, data files included;
# another distribution by its version. What `code_digest` and `versions` answer for is left out.

KNOWN_MODULES = {"jerkbench", "numpy", "scipy", "numba", "pandas", "filterpy", "pymap3d", "hydra", "omegaconf"}
"""Modules whose version or code is in every key."""

MOST_HASHED_BYTES = 64_000_000
"""A larger file counts by its size and the time of its last change."""

CACHES, RESULTS = "__pycache__", "results"
"""Folders on which nothing depends."""

NamedFile = tuple[str, Path]
"""A file, and what it is called: its place in its package."""


@cache
def plugin_digest(cls: type) -> str:
    """Hash of all that a plugin outside this package depends on, and that of its bases.

    Empty for our own plugins, which `code_digest` covers. A class without a file, of an interactive session, has
    another one in each process: nothing tells whether it changed.
    """
    named = [line for base in cls.__mro__ for line in _named(base)]
    homes = {c.__module__.partition(".")[0] for c in cls.__mro__} - KNOWN_MODULES - sys.stdlib_module_names
    try:
        texts = [*map(sources_digest, sorted(homes)), *named]
        return hashlib.sha256("".join(texts).encode()).hexdigest() if texts else ""
    except LookupError:
        return _this_process()


def _named(cls: type) -> Iterator[str]:
    """Yield a line for each place that the class itself names in `depends_on`."""
    file, names = getattr(sys.modules.get(cls.__module__), "__file__", None), vars(cls).get("depends_on", ())
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise PluginError(f'{cls.__name__}.depends_on is {names!r}; give a tuple of texts, such as ("gains.csv",).')
    return named_digests(names, Path(file).parent if file else Path())


@cache
def _this_process() -> str:
    return secrets.token_hex(32)


def sources_digest(module: str) -> str:
    """Return a hash of what ``module`` depends on: files by content, distributions by version.

    Raises:
        LookupError: it has no file: nothing tells it apart from another of the same name.
    """
    return _hash("".join(f"{line}\n" for line in sorted(set(_lines(module)))))


def _lines(module: str) -> Iterator[str]:
    """Yield a line for each file and each distribution."""
    own = _top(module)
    waiting, visited = [own], {own}
    while waiting:
        top = waiting.pop()
        installed = _installed(top)
        if installed is not None and top != own and installed.name not in _owners().get(own, ()):
            yield from _released(installed, set())
            continue
        files = list(_loose(top, required=top == own) if installed is None else _whole(installed, top))
        yield from (f"{name} {_content(path)}" for name, path in files)
        for name in sorted(
            _reached(top, [path for _, path in files]) - visited - KNOWN_MODULES - sys.stdlib_module_names
        ):
            visited.add(name)
            waiting.append(name)


def _top(module: str) -> str:
    return module.partition(".")[0]


def _reached(top: str, files: list[Path]) -> set[str]:
    """Return the modules that the files import, and those whose objects stand in what is loaded of them."""
    modules = [path for path in files if path.suffix == ".py"]
    names = {name for path in modules for name in imported_names(path)}
    if (place := _place(top)) is not None and not place.is_dir():  # a lone module may load those beside it by name
        texts = {Path(text).stem for path in modules for text in named_places(path)}
        names |= {text for text in texts if (place.parent / f"{text}.py").is_file()}
    for name, module in list(sys.modules.items()):
        if _top(name) == top and module is not None:
            names |= {_home(value) for value in list(vars(module).values())}
    return {_top(name) for name in names}


def _home(value: object) -> str:
    """Return the module that ``value`` is, or where it, or its type, is defined."""
    if isinstance(value, ModuleType):
        return value.__name__
    return value.__module__ if isinstance(value, (type, FunctionType)) else type(value).__module__


@cache
def _owners() -> dict[str, list[str]]:
    """The distributions that bring each module, by its name."""
    return {name: sorted(set(owners)) for name, owners in packages_distributions().items()}


def _installed(top: str) -> Distribution | None:
    """Return the distribution that ``top`` comes from; None where its files lie elsewhere, or it has none."""
    place = _place(top)
    if place is None:
        return None
    several = map(distribution, _owners().get(top, ()))
    return next((d for d in several if d.files and place.is_relative_to(Path(str(d.locate_file(""))).resolve())), None)


def _place(top: str) -> Path | None:
    """Return the folder of a package, or the file of a module; None where it has none."""
    module = sys.modules.get(top)
    spec, file = (getattr(module, name, None) for name in ("__spec__", "__file__"))
    if module is None:
        try:
            spec = find_spec(top)
        except (ImportError, ValueError):
            return None
        file = spec.origin if spec is not None and spec.has_location else None
    folders = list(getattr(spec, "submodule_search_locations", None) or getattr(module, "__path__", None) or ())
    place = folders[0] if folders else file
    return Path(place).resolve() if place else None


def _whole(installed: Distribution, top: str) -> Iterator[NamedFile]:
    """Yield every file of a distribution, and what was put into the package's folder later."""
    for file in installed.files or ():
        path = Path(str(file.locate()))
        if path.is_file() and CACHES not in file.parts and not file.parts[0].endswith(".dist-info"):
            yield str(file), path
    if (place := _place(top)) is not None and place.is_dir():
        yield from _loose(top, required=False)


def _loose(top: str, *, required: bool) -> Iterator[NamedFile]:
    """Yield the files of a package; of a module that stands alone, itself, and the data beside it."""
    place = _place(top)
    if place is None:
        if required:
            raise LookupError(top)
        return
    paths = _below(place) if place.is_dir() else (place, *_beside(place))
    yield from ((path.relative_to(place.parent).as_posix(), path) for path in paths)


def _below(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).parts
        if path.is_file() and not any(part == CACHES or part.startswith(".") for part in inside):
            yield path


def _beside(module: Path) -> Iterator[Path]:
    """Yield the data files in the folder of a lone module, and those in folders that it names."""
    for path in sorted(module.parent.iterdir()):
        if path.is_file() and path.suffix not in (".py", ".pyc", ".log") and not path.name.startswith("."):
            yield path
        elif path.is_dir() and path.name in named_places(module) and path.name != RESULTS:
            yield from _below(path)


def named_digests(names: Iterable[str], home: Path) -> Iterator[str]:
    """Yield a line for each of ``names``: a file or folder seen from the folder ``home``, or $NAME, a variable."""
    for name in names:
        path = home / name
        if name.startswith("$"):
            yield f"{name} {os.environ.get(name[1:])!r}"
        elif path.is_dir():
            yield from (f"{name} {inside.relative_to(path)} {_content(inside)}" for inside in _below(path))
        else:
            yield f"{name} {_content(path) if path.is_file() else 'is not there'}"


def _content(path: Path) -> str:
    stat = path.stat()
    if stat.st_size > MOST_HASHED_BYTES:
        return f"{stat.st_size} {stat.st_mtime_ns}"
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _released(installed: Distribution, visited: set[str]) -> Iterator[str]:
    """Yield name and version of a distribution, and of those that it requires."""
    if installed.name in visited:
        return
    visited.add(installed.name)
    yield f"{installed.name} {installed.version}"
    for requirement in installed.requires or ():
        name = requirement.split(";")[0]
        name = "".join(c if c.isalnum() or c in "-_." else " " for c in name).split(" ")[0]
        if "extra ==" not in requirement:
            with suppress(PackageNotFoundError):
                yield from _released(distribution(name), visited)


def named_places(path: Path) -> set[str]:
    """Return the first part of every text in the file that may be the name of a file or a folder."""
    texts = (node.value for node in ast.walk(_parsed(path)) if isinstance(node, ast.Constant))
    return {text.split("/")[0] for text in texts if isinstance(text, str) and len(text) < 256}


def imported_names(path: Path) -> Iterator[str]:
    """Yield the modules that the file imports by name, also inside functions; not those of its own package."""
    for node in ast.walk(_parsed(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            yield from (arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant) and type(arg.value) is str)


def _parsed(path: Path) -> ast.Module:
    """The file's syntax; of one that is no Python, nothing."""
    try:
        return ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return ast.Module(body=[], type_ignores=[])
