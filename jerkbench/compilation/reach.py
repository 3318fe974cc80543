"""What a function reaches: the helpers it calls, the constants it reads, and a digest of all of it."""

import hashlib
import inspect
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

LIBRARIES = ("numpy", "math", "cmath", "numba", "builtins", "scipy")
"""Modules whose functions numba knows, or cannot know; nothing in them is looked into."""


def digest(function: Callable[..., Any], **more: object) -> str:
    """Return a hash of the byte code of ``function``, of every helper that it reaches, and of the values they read.

    An edit in a helper in another file changes it; an edit of a comment does not.
    """
    sha = hashlib.sha256(repr(sorted(more.items())).encode())
    _feed(sha, function, set())
    return sha.hexdigest()[:16]


def own_function(value: object) -> types.FunctionType | None:
    """Return the Python function behind ``value``, or None where it is none (or a library's)."""
    function = getattr(value, "py_func", value)  # whoever wrote it may have put numba.njit above it
    if isinstance(function, types.FunctionType) and not _of_library(function.__module__):
        return function
    return None


def reached(function: types.FunctionType) -> dict[str, Any]:
    """Return the globals that ``function`` reads, by name."""
    names = sorted(set(_names(function.__code__)))
    return {name: function.__globals__[name] for name in names if name in function.__globals__}


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def _feed(sha: Any, value: object, seen: set[int]) -> None:  # noqa: ANN401 - hashlib names no type for its objects
    """Add ``value`` to the hash: code for a function, content for anything else."""
    function = own_function(value)
    if function is not None:
        if id(function) not in seen:
            seen.add(id(function))
            _feed_function(sha, function, seen)
    elif isinstance(value, types.ModuleType):
        sha.update(_module_content(value))
    elif isinstance(value, np.ndarray):
        sha.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, np.generic):
        sha.update(f"{value.dtype}".encode() + value.tobytes())
    elif isinstance(value, (tuple, list)):
        sha.update(f"{len(value)} of".encode())
        for item in value:
            _feed(sha, item, seen)
    elif isinstance(value, type) and hasattr(value, "_fields"):  # a named tuple: which number is which
        sha.update(f"{value.__qualname__} {value._fields}".encode())
    elif isinstance(value, (bool, int, float, complex, str, bytes, frozenset, type(None))):
        sha.update(repr(value).encode())
    else:
        sha.update(f"{type(value).__qualname__} {getattr(value, '__qualname__', '')}".encode())


def _feed_function(sha: Any, function: types.FunctionType, seen: set[int]) -> None:  # noqa: ANN401 - as above
    _feed_code(sha, function.__code__)
    _feed(sha, function.__defaults__, seen)
    for name, value in reached(function).items():
        sha.update(name.encode())
        _feed(sha, value, seen)
    for cell in function.__closure__ or ():
        _feed(sha, cell.cell_contents, seen)


def _feed_code(sha: Any, code: types.CodeType) -> None:  # noqa: ANN401 - as above
    sha.update(code.co_code)
    sha.update(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _feed_code(sha, constant)
        else:
            sha.update(repr(constant).encode())


def _module_content(module: types.ModuleType) -> bytes:
    """The source of a module (its constants may be read); of a library only the name."""
    if _of_library(module.__name__):
        return module.__name__.encode()
    try:
        source = inspect.getsourcefile(module)
    except TypeError:
        source = None
    return Path(source).read_bytes() if source else module.__name__.encode()


def _of_library(module: str | None) -> bool:
    return (module or "").split(".", 1)[0] in LIBRARIES
