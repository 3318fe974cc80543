"""Functions that numba compiles, and the cache on disk from which later processes load the compiled code.

After a change in another file that a function uses, the cache of numba returns outdated code, so each compiled function
has a separate cache folder. The name of the folder contains a digest of the source files of all functions that are
called directly or indirectly, and of the constants that these functions read.
"""

import hashlib
import os
import shutil
import stat
import sys
import types
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from threading import RLock
from typing import Annotated, Any, Final, cast, get_args, get_origin, get_type_hints

import numpy as np
from filelock import FileLock, Timeout

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import notify
from jerkbench.files import cache_folder

COMPILED = "compiled"
"""Name of the cache of compiled code."""

Function = Callable[..., Any]

LIBRARIES = {"numpy", "numba", "llvmlite", "scipy", *sys.stdlib_module_names}
"""Modules whose functions are not compiled here, because numba supports these functions or cannot compile them."""


def can_compile() -> bool:
    """Return whether numba compiles functions. The environment variable NUMBA_DISABLE_JIT=1 disables compilation."""
    from numba import config

    return not config.DISABLE_JIT


class Compilation:
    """A function with its signature and compiler options. The method `result` returns the compiled function.

    Args:
        function: a plain Python function. The plain functions that ``function`` calls are also compiled.
        title: name of the function in the message that is printed during the compilation, or None for no message.
        signature: signature of the function as a numba type. By default, the signature is derived from the annotations.
        contract: whether the function is a kernel. A kernel creates no arrays, so numba omits the code for reference
            counting, which takes most of the compilation time. In a kernel, the compiler may contract a product and a
            sum to one fused multiply-add instruction.
        in_lanes: whether the functions of `jerkbench.compilation.lanes` operate on vectors with the numbers of eight
            runs.
    """

    def __init__(
        self,
        function: Function,
        title: str | None,
        signature: Any = None,  # noqa: ANN401 - numba has no types
        *,
        contract: bool = False,
        in_lanes: bool = False,
    ) -> None:
        self.function, self.title = cast("types.FunctionType", function), title
        self.signature, self.contract, self.in_lanes = signature or signature_of(function), contract, in_lanes
        self.key = f"{function.__name__}-{digest(function, f'{self.signature} {contract} {in_lanes}')}"

    def result(self, *, wait: bool = True) -> Any:  # noqa: ANN401 - numba has no types
        """Return the compiled function. The function is compiled, or loaded from the cache, on the first call.

        If another process is compiling the function, wait until that process has finished. If ``wait`` is false, return
        None instead of waiting.
        """
        with _COMPILING:
            if self.key not in _KNOWN:
                folder = private_folder(self.key) if Path(self.function.__code__.co_filename).is_file() else None
                try:
                    with FileLock(folder / "lock", timeout=-1 if wait else 0) if folder else nullcontext():
                        _KNOWN[self.key] = self._compiled(folder)
                except Timeout:
                    return None
                except Exception as error:  # noqa: BLE001 - numba and the source of a plugin raise any type
                    _KNOWN[self.key] = error
            if isinstance(_KNOWN[self.key], Exception):
                raise _KNOWN[self.key]
            return _KNOWN[self.key]

    def _compiled(self, folder: Path | None) -> Any:  # noqa: ANN401 - numba has no types
        if folder is None or not any(folder.rglob("*.nbc")):
            if self.title:
                notify(f"Compiling {self.title}. This is needed once and takes a few seconds.")
            return self._by_numba(folder)
        try:
            return self._by_numba(folder)
        except Exception:  # noqa: BLE001 - a damaged file may raise any exception
            shutil.rmtree(folder)
            folder.mkdir(mode=0o700)
            return self._by_numba(folder)

    def _by_numba(self, folder: Path | None) -> Any:  # noqa: ANN401 - numba has no types
        from jerkbench.compilation.vectors import set_environments

        entry = _copy(self.function, _Jit(self.key, self.contract, self.in_lanes))
        with _cache_in(folder):
            found = _decorator(self.contract, self.signature, cache=folder is not None)(entry)
        set_environments(found)
        return found


_COMPILING = RLock()
_KNOWN: Final[dict[str, Any]] = {}


def compile_all(compilations: Sequence[Compilation]) -> None:
    """Compile all functions that are not compiled yet.

    Functions that no other process is compiling are compiled first, so that several processes work in parallel. A
    function that cannot be compiled is skipped.
    """
    for wait in (False, True):
        for compilation in compilations:
            with suppress(Exception):  # the next call of `result` raises the error again
                compilation.result(wait=wait)


# Compilation of a plain function, including all functions that the function calls.


def _decorator(contract: bool, signature: Any = None, **options: Any) -> Function:  # noqa: ANN401 - numba has no types
    from numba import njit

    if contract:
        options |= {"fastmath": {"contract"}, "_nrt": False}
    signatures = () if signature is None else (signature,)
    made: Function = njit(*signatures, error_model="numpy", nogil=True, **options)
    return made


def not_inlined(function: Function) -> Function:
    """Mark a long or rarely called function as not to be inlined. The compiler inlines all other functions."""
    function.not_inlined = True  # type: ignore[attr-defined]
    return function


class _Jit:
    """Creates the numba dispatchers of all functions that a compiled function calls, directly or indirectly."""

    def __init__(self, home: str, contract: bool, in_lanes: bool) -> None:
        from jerkbench.compilation.vectors import IN_LANES

        self.home, self.contract = home, contract
        self.replaced: dict[Any, Any] = IN_LANES if in_lanes else {}
        self.done: dict[types.FunctionType, Any] = {}
        self.started: list[types.FunctionType] = []

    def value(self, value: Any) -> Any:  # noqa: ANN401 - any global of a module
        """Return the numba dispatcher of ``value`` if it is a plain function, or else ``value`` unchanged."""
        function = own_function(value)
        if function is None:
            return value
        if function in self.replaced:
            replacement = self.replaced[function]
            return self.value(replacement) if own_function(replacement) else replacement
        if function in self.started[:-1]:
            raise TypeError(f"{function.__name__} calls a function that calls {function.__name__} again")
        if function not in self.done:
            from jerkbench.compilation.vectors import InnerCompiler

            options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": InnerCompiler}
            options["forceinline"] = not hasattr(function, "not_inlined")
            self.started.append(function)
            self.done[function] = _decorator(self.contract, **options)(_copy(function, self))
            self.started.pop()
        return self.done[function]


def _copy(function: types.FunctionType, jit: _Jit) -> types.FunctionType:
    """Return a copy of a function in which all global functions are replaced by their numba dispatchers.

    The copy belongs to a separate module, because the linker distinguishes functions by module and name.
    """
    home = sys.modules.setdefault(jit.home, types.ModuleType(jit.home))
    scope = {name: jit.value(value) for name, value in globals_of(function).items()}
    scope |= {"__name__": home.__name__, "__builtins__": __builtins__}
    cells = tuple(types.CellType(jit.value(cell.cell_contents)) for cell in function.__closure__ or ())
    copy = types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__, cells or None)
    copy.__kwdefaults__, copy.__module__, copy.__qualname__ = function.__kwdefaults__, jit.home, function.__qualname__
    vars(copy).update(vars(function))
    return copy


def own_function(value: object) -> types.FunctionType | None:
    """Return the plain Python function behind ``value``, without the decorator of numba.

    Return None if ``value`` is not a Python function, or if it is a function of a library.
    """
    function: Any = getattr(value, "py_func", value)  # numba.njit stores the plain function in py_func
    is_plain = isinstance(function, types.FunctionType) and (function.__module__ or "").split(".")[0] not in LIBRARIES
    return function if is_plain else None


def globals_of(function: types.FunctionType) -> dict[str, Any]:
    """Return a dictionary with the names and values of the global variables that ``function`` reads."""
    return {name: function.__globals__[name] for name in _names(function.__code__) if name in function.__globals__}


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


# The digest of a function and all functions that the function calls.


def digest(function: Function, more: str = "") -> str:
    """Return a digest of the source files and constants of ``function`` and of all functions that it calls."""
    files: set[str] = set(map(str, Path(__file__).parent.glob("*.py")))
    constants: list[str] = [more]
    seen: set[int] = set()
    pending: list[Any] = [function]
    while pending:
        value = pending.pop()
        plain = own_function(value)
        if plain is not None and id(plain) not in seen:
            seen.add(id(plain))
            files.add(plain.__code__.co_filename)
            read = globals_of(plain)
            constants += [f"{name} {text}" for name, value in read.items() if (text := _constant(value))]
            pending += [*read.values(), *(cell.cell_contents for cell in plain.__closure__ or ())]
            constants += [_constant(value) for value in plain.__defaults__ or ()]
        elif isinstance(value, types.ModuleType) and value.__name__.split(".")[0] not in LIBRARIES:
            files.add(value.__file__ or "")
    sha = hashlib.sha256("\n".join(sorted(constants)).encode())
    for file in sorted(files):
        sha.update(Path(file).read_bytes() if Path(file).is_file() else file.encode())
    return sha.hexdigest()[:16]


def _constant(value: object) -> str:
    """Return the text of a constant, or the field names of a named tuple. The text of any other object is empty."""
    if isinstance(value, (bool, int, float, complex, str, bytes, tuple, frozenset, np.generic)):
        return repr(value)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    return str(getattr(value, "_fields", ""))


# The cached files contain machine code, so they are loaded only from folders to which other users cannot write.


def private_folder(key: str) -> Path | None:
    """Return the cache folder ``key``. If the folder cannot be created or is not private, warn and return None."""
    root = cache_folder(COMPILED)
    folder = root / key
    try:
        root.parent.mkdir(parents=True, exist_ok=True)
        for path in (root, folder):
            path.mkdir(mode=0o700, exist_ok=True)
            _require_private(path)
    except OSError as error:
        reason = error.strerror or str(error)
        notify(
            f"Compiled code is not cached in {root}: {reason}. Each process compiles the code again. Set"
            " JERKBENCH_CACHE to a folder that only you can write to.",
            "compiled code is not cached",
        )
        return None
    return folder


def _require_private(path: Path) -> None:
    """Raise an OSError if ``path`` is not a folder, or if other users can write to it (not checked on Windows)."""
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise NotADirectoryError(0, f"{path} is not a folder")
    if hasattr(os, "geteuid") and (found.st_uid != os.geteuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)):
        raise PermissionError(0, f"other users can write to {path}")


@contextmanager
def _cache_in(folder: Path | None) -> Iterator[None]:
    """Set the cache folder of numba to ``folder`` within the block."""
    from numba import config

    ours = {"CACHE_DIR": str(folder or ""), "CACHE_LOCATOR_CLASSES": ""}
    before = {name: getattr(config, name) for name in ours if hasattr(config, name)}
    try:
        for name in before:
            setattr(config, name, ours[name])
        yield
    finally:
        for name, value in before.items():
            setattr(config, name, value)


# Conversion of annotations to numba types.
# An annotation is a number type, an array type of `jerkbench.arrays`, or a tuple of annotations.


def signature_of(function: Function) -> Any:  # noqa: ANN401 - numba has no types
    """Return the signature of ``function`` as a numba type, derived from its annotations."""
    *arguments, result = map(numba_type, get_type_hints(function, include_extras=True).values())
    return result(*arguments)


def numba_type(hint: Any) -> Any:  # noqa: ANN401 - an annotation
    """Return the numba type for an annotation."""
    from numba import types as numba_types

    plain = {
        float: numba_types.float64,
        int: numba_types.int64,
        bool: numba_types.boolean,
        type(None): numba_types.void,
    }
    elements = {FloatArray: numba_types.float64, IntArray: numba_types.int64, BoolArray: numba_types.boolean}
    if hint in plain:
        return plain[hint]
    if get_origin(hint) is Annotated:
        array, axes = get_args(hint)
        return numba_types.Array(elements[array], axes, "C")
    if get_origin(hint) is tuple:
        return numba_types.Tuple([*map(numba_type, get_args(hint))])
    parts = [*map(numba_type, get_type_hints(hint, include_extras=True).values())]
    if len(set(parts)) == 1:
        return numba_types.NamedUniTuple(parts[0], len(parts), hint)
    return numba_types.NamedTuple(parts, hint)
