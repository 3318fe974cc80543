"""Entry points: small generated modules, real files, because numba keeps on disk only what comes from a file."""

import hashlib
import importlib.util
import platform
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

from filelock import FileLock, Timeout

from jerkbench.files import cache_folder, write_text

Namespace = Callable[[str], Mapping[str, Any]]

_LOADING = RLock()
"""A module that another thread is still loading would look finished."""


COMPILED = "compiled"
"""The kind of cache that holds compiled code."""


def load_entry(title: str, source: str, key: str, namespace: Namespace) -> ModuleType:
    """Import the entry point ``source``; it compiles what it defines, or finds it compiled on the disk.

    Args:
        title: what is compiled, for the line that says so.
        source: text of the module, which defines ``entry``. Together with ``key`` it names the file.
        key: digest of everything that the entry point calls.
        namespace: given the module's name, the values that stand in the module before its first line.
    """
    name = _module_name(title, source, key)
    with _LOADING:
        if name in sys.modules:
            return sys.modules[name]
        path = _path(name)
        if not path.exists():
            write_text(path, source)
        if _compiled(path):
            return _imported(name, path, namespace)
        with _alone(path, title):
            if not _compiled(path):
                sys.stderr.write(f"jerkbench: compiling {title}, once, some seconds; it is kept in {path.parent}\n")
            return _imported(name, path, namespace)


def is_kept(title: str, source: str, key: str) -> bool:
    """Whether `load_entry` would find the entry point on the disk, compiled."""
    return _compiled(_path(_module_name(title, source, key)))


def _path(name: str) -> Path:
    return cache_folder(COMPILED) / f"{name}.py"


def _compiled(path: Path) -> bool:
    """Whether the entry point at ``path`` is on the disk, compiled."""
    return any((path.parent / "__pycache__").glob(f"{path.stem}.*.nbi"))


@contextmanager
def _alone(path: Path, title: str) -> Iterator[None]:
    """Of several processes that start together let one compile."""
    lock = FileLock(path.with_suffix(".lock"))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        sys.stderr.write(f"jerkbench: waiting for {title}, which another process is compiling\n")
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


@contextmanager
def _vectorised() -> Iterator[None]:
    """Let LLVM join like operations of straight code into vectors, which numba leaves out by default."""
    from numba import config

    before = config.SLP_VECTORIZE
    config.SLP_VECTORIZE = 1
    try:
        yield
    finally:
        config.SLP_VECTORIZE = before


def _module_name(title: str, source: str, key: str) -> str:
    import numba

    versions = f"{numba.__version__} {platform.python_version()} {_own_digest()}"
    digest = hashlib.sha256(f"{versions} {key} {source}".encode()).hexdigest()[:16]
    return f"jerkbench_{''.join(c if c.isalnum() else '_' for c in title)}_{digest}"


@cache
def _own_digest() -> str:
    """Hash of this package: how something is compiled decides on the result as well."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


def _set_environments(entry: Any) -> None:  # noqa: ANN401 - numba has no types
    """Let inner functions find what they hand to Python; numba does so for what it makes machine code of alone."""
    for compiled in entry.overloads.values():
        for environment in compiled._find_referenced_environments():  # noqa: SLF001 - as numba does when it loads one
            compiled.codegen.set_env(environment.env_name, environment)


def _imported(name: str, path: Path, namespace: Namespace) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module; delete it and try again.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba looks there when it loads compiled code
    try:
        module.__dict__.update(namespace(name))
        with _vectorised():
            spec.loader.exec_module(module)
        _set_environments(module.entry)
    except BaseException:
        del sys.modules[name]
        raise
    return module
