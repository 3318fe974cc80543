"""The content of a value that compiled code may read, in bytes that are the same in every process."""

import enum
import sys
import types
from typing import Any

import numpy as np

LIBRARIES = ("numpy", "numba", "llvmlite", "scipy")
"""Besides the standard library, modules whose functions numba knows, or cannot know; nothing in them is looked into."""

OWN = "jerkbench.compilation."
"""Of these modules every entry point knows the whole source."""

PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))


def of_library(module: str | None) -> bool:
    """Whether ``module`` belongs to a library, whose version tells it apart."""
    top = (module or "").split(".", 1)[0]
    return top in LIBRARIES or top in sys.stdlib_module_names


def library_name(module: str) -> str:
    """Return the name of a library's ``module`` with the library's version."""
    return f"{module} {getattr(sys.modules.get(module.split('.', 1)[0]), '__version__', '')}"


def content(value: Any) -> bytes | None:  # noqa: ANN401 - any global of a module
    """Return what tells ``value`` apart from any other; None where nothing can."""
    if type(value) in PLAIN:
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
    if module.startswith(OWN):
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
