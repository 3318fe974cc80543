"""The digest of all that a function reaches: the helpers it calls and the constants it reads."""

import enum
import functools
import hashlib
import re
import secrets
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

# The content of a value that compiled code may read, in bytes that are the same in every process.

LIBRARIES = ("numpy", "numba", "llvmlite", "scipy")
"""Besides the standard library, modules whose functions numba knows, or cannot know; nothing in them is looked into."""

_OWN = "jerkbench.compilation."
"""Of these modules every entry point knows the whole source."""

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))


def of_library(module: str | None) -> bool:
    """Whether ``module`` belongs to a library, whose version tells it apart."""
    top = (module or "").split(".", 1)[0]
    return top in LIBRARIES or top in sys.stdlib_module_names


def library_name(module: str) -> str:
    """Return the name of a library's ``module`` with the library's version."""
    return f"{module} {getattr(sys.modules.get(module.split('.', 1)[0]), '__version__', '')}"


def content(value: Any) -> bytes | None:  # noqa: ANN401 - any global of a module
    """Return what tells ``value`` apart from any other; None where nothing can."""
    if type(value) in _PLAIN:
        return f"{type(value).__name__} {value!r}".encode()
    if isinstance(value, np.ndarray):
        return None if value.dtype.hasobject else f"{value.dtype.descr}{value.shape}".encode() + value.tobytes()
    if isinstance(value, (np.generic, np.dtype)):
        return _numpy_content(value)
    if isinstance(value, enum.Enum):
        return _after(f"member {type(value).__qualname__}.{value.name} ", content(value.value))
    if isinstance(value, type) and (made := _class_content(value)) is not None:
        return made
    name = _name(value)
    return None if name is None else name.encode()


def _numpy_content(value: Any) -> bytes | None:  # noqa: ANN401 - NumPy's scalars and types
    if isinstance(value, np.dtype):
        return None if value.hasobject else f"dtype {value.descr}".encode()
    return None if value.dtype.hasobject else f"{value.dtype.descr}".encode() + value.tobytes()


def _class_content(cls: type) -> bytes | None:
    """Of a named tuple which number is which; of an enumeration the value of each name."""
    if hasattr(cls, "_fields"):
        return f"{cls.__qualname__} {cls._fields} {sorted(getattr(cls, '_field_defaults', {}).items())}".encode()
    if issubclass(cls, enum.Enum):
        members = [(name, content(member.value)) for name, member in cls.__members__.items()]
        known = all(inside is not None for _, inside in members)
        return f"{cls.__qualname__} {members}".encode() if known else None
    return None


def _name(value: Any) -> str | None:  # noqa: ANN401 - as above
    """Return the name of what a library, or this package's own compiler, defines."""
    module = getattr(value, "__module__", None)
    if isinstance(value, np.ufunc):
        module = "numpy" if getattr(np, value.__name__, None) is value else "scipy.special"
    if not isinstance(module, str):
        return None
    name = getattr(value, "__qualname__", None) or getattr(value, "__name__", None)
    if module.startswith(_OWN):
        return f"{module} {name or value!r}"
    if not of_library(module):
        return None
    if _is_numba_type(value):
        return f"{library_name('numba')} {value!s}"
    return f"{library_name(module)} {name}" if name and _resolved(module, name) is value else None


def _is_numba_type(value: object) -> bool:
    return any(c.__module__ == "numba.core.types.abstract" and c.__name__ == "Type" for c in type(value).__mro__)


def _resolved(module: str, name: str) -> object:
    """Return what stands under ``name`` in ``module``, or None."""
    value: object = sys.modules.get(module)
    for part in name.split("."):
        value = getattr(value, part, None)
    return value


def _after(before: str, inside: bytes | None) -> bytes | None:
    return None if inside is None else before.encode() + inside


def code_content(code: types.CodeType) -> bytes:
    """Return what a function's byte code does, without its constants: names, arguments, instructions."""
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    return repr((names, arguments, code.co_code, code.co_exceptiontable)).encode()


_UNKNOWN = "unknown "
"""Beginning of a key of which a part cannot be told apart from another: it holds in this process only."""

OPTIONS = ("targetoptions", "_sig", "signature", "identity", "nin", "nout")
"""What besides its function decides on one of numba's wrappers."""

_THIS_PROCESS = secrets.token_hex(16)
_KNOWN_BY_PLACE: list[object] = []
"""Objects that are known by where they lie; while they stand here no other can take their place."""


def digest(function: Callable[..., Any], **more: object) -> str:
    """Return a hash of the byte code of ``function``, of every helper that it reaches, and of the values they read.

    An edit in a helper in another file changes it; an edit of a comment does not. Where it reaches something whose
    content cannot be told, it begins with `UNKNOWN` and the name of that, and no other process finds the same.
    """
    reading = _Reading()
    reading.add("options", repr(sorted(more.items())).encode())
    reading.value(function, ())
    content = reading.sha.hexdigest()[:16]
    return f"{_UNKNOWN}{reading.unknown} {content}" if reading.unknown else content


def unknown_part(key: str) -> str:
    """Return the name of what made ``key`` hold in this process only; empty where it holds everywhere."""
    return key.removeprefix(_UNKNOWN).rpartition(" ")[0] if key.startswith(_UNKNOWN) else ""


def own_function(value: object) -> types.FunctionType | None:
    """Return the Python function behind ``value``, or None where it is none (or a library's)."""
    function = getattr(value, "py_func", value)  # whoever wrote it may have put numba.njit above it
    if isinstance(function, types.FunctionType) and not of_library(function.__module__):
        return function
    return None


def reached(function: types.FunctionType) -> dict[str, Any]:
    """Return the globals that ``function`` reads, by name."""
    names = sorted(set(_names(function.__code__)))
    return {name: function.__globals__[name] for name in names if name in function.__globals__}


def reads(function: types.FunctionType, name: str) -> bool:
    """Return whether ``function``, or a helper that it reaches, reads the global ``name``."""
    seen, ahead = {function}, [function]
    while ahead:
        values = reached(ahead.pop())
        if name in values:
            return True
        helpers = {helper for value in values.values() if (helper := own_function(value))} - seen
        seen |= helpers
        ahead += helpers
    return False


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


class _Reading:
    """A hash, what has gone into it, and the first thing whose content cannot be told."""

    def __init__(self) -> None:
        self.sha = hashlib.sha256()
        self.seen: dict[object, int] = {}
        self.unknown = ""
        self.name = ""

    def add(self, kind: str, inside: bytes) -> None:
        """Add bytes, so that no two sequences of them look alike."""
        self.sha.update(f"{kind} {len(inside)} ".encode() + inside)

    def value(self, value: Any, names: tuple[str, ...]) -> None:  # noqa: ANN401 - any global of a module
        """Add ``value``: code for a function, content for anything else.

        ``names`` are those that the code around it uses; of a module only what has one of them is read.
        """
        function = own_function(value)
        if function is not None:
            self._options(value)
            self._once(function, lambda: self._function(function))
        elif isinstance(value, types.ModuleType):
            self._module(value, names)
        elif isinstance(value, functools.partial):
            self.items("partial", (value.func, value.args, value.keywords), names)
        elif isinstance(value, (tuple, list)):
            self.items(f"{type(value).__qualname__} {getattr(value, '_fields', '')}", value, names)
        elif type(value) is dict:
            self.items("dict", [item for pair in value.items() for item in pair], names)
        elif isinstance(value, (set, frozenset)):
            self.items("set", sorted(value, key=repr), names)
        elif (wrapped := _wrapped(value)) is not None:
            self._options(value)
            self._once(wrapped, lambda: self._function(wrapped))
        else:
            self._leaf(value)

    def items(self, kind: str, values: Any, names: tuple[str, ...]) -> None:  # noqa: ANN401 - a sequence of anything
        """Add each of ``values``."""
        self.add(kind, str(len(values)).encode())
        for value in values:
            self.value(value, names)

    def _once(self, key: object, read: Callable[[], None]) -> None:
        """Read a function or a module; where it came up before, say which of those it was."""
        is_new = key not in self.seen
        self.add("number", str(self.seen.setdefault(key, len(self.seen))).encode())
        if is_new:
            read()

    def _function(self, function: types.FunctionType) -> None:
        names = tuple(sorted(set(_names(function.__code__))))
        self._code(function.__code__, names)
        self.items("defaults", function.__defaults__ or (), names)
        self._named("keywords", function.__kwdefaults__ or {}, names)
        self._named("globals", reached(function), names)
        self.items("closure", [cell.cell_contents for cell in function.__closure__ or ()], names)

    def _code(self, code: types.CodeType, names: tuple[str, ...]) -> None:
        self.add("code", code_content(code))
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._code(constant, names)
            else:
                self.value(constant, names)

    def _module(self, module: types.ModuleType, names: tuple[str, ...]) -> None:
        """Read what a module has under one of ``names``; of a library only the name."""
        if of_library(module.__name__):
            self.add("library", library_name(module.__name__).encode())
            return
        inside = vars(module)
        if "__getattr__" in inside:
            self._leaf(inside["__getattr__"])  # what it would return is anybody's guess
        values = {name: inside[name] for name in names if name in inside}
        self._once((id(module), names), lambda: self._named(module.__name__, values, names))

    def _named(self, kind: str, values: Mapping[str, Any], names: tuple[str, ...]) -> None:
        for name in sorted(values):
            self.add(kind, name.encode())
            self.name = name
            self.value(values[name], names)

    def _options(self, value: Any) -> None:  # noqa: ANN401 - a function, or numba's wrapper of one
        """Add the options with which numba compiles a function that is wrapped already."""
        for name in OPTIONS if type(value).__module__.startswith("numba.") else ():
            if name in dir(value):
                self.add(name, re.sub(r" at 0x\w+", "", str(getattr(value, name))).encode())

    def _leaf(self, value: Any) -> None:  # noqa: ANN401 - as above
        inside = content(value)
        if inside is None:
            _KNOWN_BY_PLACE.append(value)
            self.unknown = self.unknown or f"{self.name} ({type(value).__name__})"
            inside = f"{_THIS_PROCESS} {id(value)}".encode()
        self.add("value", inside)


def _wrapped(value: Any) -> types.FunctionType | None:  # noqa: ANN401 - as above
    """Return the function behind one of numba's other wrappers: vectorize, guvectorize, cfunc, intrinsic."""
    function = getattr(value, "__wrapped__", None) if type(value).__module__.startswith("numba.") else None
    return function if isinstance(function, types.FunctionType) and not _told_by_name(function.__module__) else None


def _told_by_name(module: str | None) -> bool:
    return of_library(module) or (module or "").startswith(_OWN)
