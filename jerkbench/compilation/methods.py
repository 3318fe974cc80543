"""Methods of a plugin, compiled as they are: `self` becomes a named tuple that is rebuilt from a vector of numbers."""

import dataclasses
from collections import namedtuple
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.entry import load_entry
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.reach import digest, own_function


class Method(NamedTuple):
    """How a method of a plugin is called from compiled code.

    Attributes:
        name: of the method.
        arguments: names of its arguments after self.
        signature: source text of its numba type; the parameters come first, ``result`` last where it fills an array.
        fills: whether what it returns is written into the array ``result``.
    """

    name: str
    arguments: tuple[str, ...]
    signature: str
    fills: bool


def parameter_vector(plugin: object) -> FloatArray:
    """Return the numbers among the plugin's fields, in their order."""
    return np.array([number for _, value in _attributes(plugin) for number in _numbers(value)], dtype=np.float64)


def compiled_method(plugin: object, method: Method) -> Any:  # noqa: ANN401 - numba has no types
    """Return the plugin's method as a compiled function of (parameters, *arguments[, result]).

    One compilation serves all values of the numeric parameters.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        TypeError: the method is no plain function.
    """
    function = own_function(getattr(type(plugin), method.name, None))
    if function is None:
        raise TypeError(f"{type(plugin).__name__}.{method.name} is not a plain function")
    fields = [name for name, _ in _attributes(plugin)]
    source = _entry_source(plugin, method)

    def namespace(home: str) -> dict[str, Any]:
        return {
            "Parameters": namedtuple("Parameters", fields),  # noqa: PYI024 - its fields are known at run time only
            "method": jitted(function, home),
        }

    title = f"{type(plugin).__name__}.{method.name}"
    module: ModuleType = load_entry(title, source, digest(function), namespace)
    return module.entry


def _entry_source(plugin: object, method: Method) -> str:
    """Text of the entry point: rebuild self, call the method."""
    arguments = ", ".join(method.arguments)
    call = f"method(Parameters({', '.join(_rebuilt(plugin))}), {arguments})"
    body = f"result[:] = {call}" if method.fills else f"return {call}"
    given = ", ".join(("parameters", *method.arguments, *(["result"] if method.fills else [])))
    return (
        f'"""Made by jerkbench: {type(plugin).__name__}.{method.name} for compiled code."""\n\n'
        f"from numba import njit\nfrom numba.types import boolean, float64, int64, void\n\n\n"
        f'@njit({method.signature}, cache=True, error_model="numpy", nogil=True)\n'
        f"def entry({given}):\n    {body}\n"
    )


def _attributes(plugin: object) -> list[tuple[str, Any]]:
    """The fields, then the plain constants of the class."""
    fields = [(f.name, getattr(plugin, f.name)) for f in dataclasses.fields(plugin)]  # type: ignore[arg-type]  # a plugin is a dataclass
    known = {name for name, _ in fields}
    constants = {
        name: value
        for cls in reversed(type(plugin).__mro__)
        for name, value in vars(cls).items()
        if not name.startswith("_") and name not in known and _is_constant(value)
    }
    return fields + sorted(constants.items())


def _is_constant(value: object) -> bool:
    return isinstance(value, (bool, int, float, str)) or (isinstance(value, tuple) and all(map(_is_constant, value)))


def _numbers(value: object) -> list[float]:
    if isinstance(value, (tuple, list)):
        return [number for item in value for number in _numbers(item)]
    return [float(value)] if isinstance(value, (bool, int, float)) else []


def _rebuilt(plugin: object) -> list[str]:
    """Source text that makes each attribute from the vector of numbers; what is no number is written out."""
    place = iter(range(10**6))
    return [_text(value, place) for _, value in _attributes(plugin)]


def _text(value: object, place: Iterator[int]) -> str:
    if isinstance(value, (tuple, list)):
        items = "".join(f"{_text(item, place)}, " for item in value)
        return f"({items})"
    if isinstance(value, bool):
        return f"parameters[{next(place)}] != 0.0"
    if isinstance(value, int):
        return f"int(parameters[{next(place)}])"
    if isinstance(value, float):
        return f"parameters[{next(place)}]"
    return repr(value)
