"""Methods of a plugin, compiled as they are, and called by their address."""

import dataclasses
import re
from collections import namedtuple
from collections.abc import Callable, Iterator
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from jerkbench.arrays import WIDE, FloatArray
from jerkbench.compilation.code_digest import digest, own_function, reads
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.lanes import above_in_lanes
from jerkbench.compilation.module_cache import load_entry
from jerkbench.compilation.vectors import anywhere, chosen, each_run, vector_of
from jerkbench.compilation.views import Untyped, View, data_of

# Calls of compiled functions by their address: a caller that is kept on the disk cannot know them by name.
#
# numba's own way, an argument of type FunctionType, takes 30 us for each function when Python hands it over, and each
# array some ten registers in a call. Here a function is a number, and an array the address of its first element.


def _caller(result: Untyped, guarded: Untyped = None, width: int = 1) -> Untyped:
    """An intrinsic ``f(address, arrays, numbers)`` that calls a function in numba's convention.

    An error that the function raises goes on to the caller's, unless the type ``guarded`` has room to say so.
    """

    def call(_typing: Untyped, address: Untyped, arrays: Untyped, numbers: Untyped) -> Untyped:
        takes = [types.CPointer(_element(array, width)) for array in arrays] + list(numbers)

        def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
            given = cgutils.unpack_tuple(builder, args[1], len(arrays))
            firsts = [
                value if isinstance(t, View) else data_of(context, builder, t, value)
                for t, value in zip(arrays, given, strict=True)
            ]
            kinds = map(context.get_value_type, takes)
            values = [builder.bitcast(first, kind) for first, kind in zip(firsts, kinds, strict=False)]
            values += cgutils.unpack_tuple(builder, args[2], len(numbers))
            convention = context.call_conv
            pointer = builder.inttoptr(args[0], convention.get_function_type(result, takes).as_pointer())
            status, returned = convention.call_function(builder, pointer, result, takes, values)
            if guarded is not None:
                well = builder.not_(status.is_error)
                return well if result == types.void else context.make_tuple(builder, guarded, [well, returned])
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value() if sig.return_type == types.void else returned

        return (guarded or result)(address, arrays, numbers), generate

    return intrinsic(call)


fill_by: Callable[..., Any] = _caller(types.void)
"""Call the function at ``address``, which returns nothing, with the data of ``arrays`` and with ``numbers``."""

ask: Callable[..., Any] = _caller(types.float64)
"""Likewise a function that returns a number."""

try_fill_by: Callable[..., Any] = _caller(types.void, types.boolean)
"""The same as `fill_by`, but an error of the function stops there; return whether there was none."""

try_ask: Callable[..., Any] = _caller(types.float64, types.Tuple([types.boolean, types.float64]))
"""The same as `ask`; return whether there was no error, and the number."""

try_fill_lanes_by: Callable[..., Any] = _caller(types.void, types.boolean, WIDE)
"""The same as `try_fill_by` of a function for several runs: of numbers, ``arrays`` and views hold vectors."""


def _element(array: Untyped, width: int) -> Untyped:
    """The type of what the called function sees there."""
    return vector_of(width) if isinstance(array, View) or array.dtype == types.float64 else array.dtype


# Methods of a plugin, compiled as they are: `self` becomes a named tuple that is rebuilt from a vector of numbers.


class CompiledMethod(NamedTuple):
    """How a method of a plugin is called from compiled code.

    Attributes:
        name: of the method.
        arguments: after self, all arrays: their names, types of their elements, and shapes as source text.
        sizes: the names that stand in the shapes.
        usual: those of them that have one value nearly always, with it; for it there is a compilation of its own. None
            where what is done with whole matrices takes far longer than the loops around it.
        result: shape of the array that it returns, or "" where it returns a number.
    """

    name: str
    arguments: tuple[tuple[str, str, str], ...]
    sizes: tuple[str, ...]
    usual: tuple[tuple[str, int], ...]
    result: str


def parameter_vector(plugin: object) -> FloatArray:
    """Return the numbers among the plugin's fields, in their order."""
    return np.array([number for _, value in _attributes(plugin) for number in _flat(value)], dtype=np.float64)


def whole_numbers(plugin: object) -> list[int]:
    """Return the whole ones among the same numbers, and 0 for the others, and for those that vary between runs."""
    numbers = [(name, number) for name, value in _attributes(plugin) for number in _flat(value)]
    return [0 if isinstance(number, float) or name in _varying(plugin) else int(number) for name, number in numbers]


def _varying(plugin: object) -> tuple[str, ...]:
    """Whole numbers of which each of several runs may have its own (`jerkbench.contracts.Adaptation`)."""
    return getattr(type(plugin), "varying", ())


def compiled_shape(plugin: object) -> tuple[object, ...]:
    """Return what `compiled_method` makes of the values of a plugin: the types of numbers, and all else as it is."""
    return tuple((name, _shape(value)) for name, value in _attributes(plugin))


def _shape(value: object) -> object:
    if isinstance(value, (tuple, list)):
        return tuple(map(_shape, value))
    return type(value) if isinstance(value, (bool, int, float)) else value


def compiled_method(plugin: object, method: CompiledMethod, width: int = 1, axes: int = 1) -> Any:  # noqa: ANN401 - numba has no types
    """Return the plugin's method as a compiled function for `jerkbench.compilation.methods`.

    It takes the addresses of the parameters, of each argument, and of the array that it fills if there is one; then
    the sizes. One compilation serves all values of the numeric parameters.

    Of several runs side by side it gets vectors of ``width`` numbers in the place of numbers. Then two arrays of
    parameters come first: the vectors, and the whole numbers, which the runs have in common. Of the usual sizes it may
    then go over each of ``axes`` by itself (`jerkbench.adaptation.linalg.AXES`).

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        numba.core.errors.UnsupportedBytecodeError: likewise; it is no NumbaError.
        TypeError: the method is no plain function.
    """
    function = own_function(getattr(type(plugin), method.name, None))
    if function is None:
        raise TypeError(f"{type(plugin).__name__}.{method.name} is not a plain function")
    fields = [name for name, _ in _attributes(plugin)]
    replaced, axes = IN_LANES if width > 1 else {}, axes if reads(function, "AXES") else 1
    source = _entry_source(plugin, method, width, axes)

    def namespace(home: str) -> dict[str, Any]:
        """Return what the entry point's text refers to."""
        return {
            "Parameters": namedtuple("Parameters", fields),  # noqa: PYI024 - its fields are known at run time only
            "method": jitted(function, home, replaced),
            "by_axes": jitted(function, home, {**replaced, "AXES": axes}) if axes > 1 else None,
            "fill": jitted(_fill, home),
            "number": vector_of(width),
        }

    states = "".join(f" of {size} states" for name, size in method.usual if name == "n")
    ways = f" for {width} runs{states}" * (width > 1) + ", axis by axis" * (axes > 1)
    title = f"{type(plugin).__name__}.{method.name}{ways}"
    module: ModuleType = load_entry(title, source, digest(function, fields=fields, width=width, axes=axes), namespace)
    return module.entry


IN_LANES = {"chosen": chosen, "anywhere": anywhere, "above": above_in_lanes, "each_run": each_run}
"""What stands for the functions of `jerkbench.compilation.lanes` side by side."""


def address_of(function: Any) -> int:  # noqa: ANN401 - numba has no types
    """Return the address of a compiled ``function`` that has one signature."""
    (compiled,) = function.overloads.values()
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


_ENTRY = '''"""Made by jerkbench: {title} for compiled code."""

from numba import carray, njit
from numba.types import CPointer, int64, void


@njit({result}({types}), cache=True, error_model="numpy", nogil=True)
def entry({names}):
{body}
'''

AS_ARRAY = "    parameters = carray(parameters, {})  # of vectors an array knows how they lie in memory\n"

BODY = """\
    if {usual}:  # with constant sizes its loops are unrolled
        {often}
    else:
        {else_}"""


def _entry_source(plugin: object, method: CompiledMethod, width: int, axes: int) -> str:
    """Text of the entry point: rebuild self, call the method."""
    arrays = [("parameters", "number"), *([("whole", "int64")] if width > 1 else [])]
    arrays += [(name, "number" if of == "float64" else of) for name, of, _ in method.arguments]
    arrays += [("result", "number")] if method.result else []
    return _ENTRY.format(
        title=f"{type(plugin).__name__}.{method.name}",
        result="void" if method.result else "number",
        types=", ".join([f"CPointer({of})" for _, of in arrays] + ["int64"] * len(method.sizes)),
        names=", ".join([name for name, _ in arrays] + list(method.sizes)),
        body=(AS_ARRAY.format(len(parameter_vector(plugin))) if width > 1 else "") + _body(plugin, method, width, axes),
    )


def _body(plugin: object, method: CompiledMethod, width: int, axes: int) -> str:
    """Text of the call; of two where some sizes are usual: of these by axes, where that is asked."""
    if not method.usual:
        return f"    {_call(plugin, method, {}, width)}"
    return BODY.format(
        usual=" and ".join(f"{name} == {size}" for name, size in method.usual),
        often=_call(plugin, method, dict(method.usual), width, "by_axes" if axes > 1 else "method"),
        else_=_call(plugin, method, {}, width),
    )


def _call(plugin: object, method: CompiledMethod, known: dict[str, int], width: int, called: str = "method") -> str:
    """Text of the call, with numbers in the place of the sizes that are ``known``."""

    def sized(shape: str) -> str:
        names = {name: str(known.get(name, name)) for name in method.sizes}
        return "".join(names.get(word, word) for word in re.split(r"(\w+)", shape))

    arrays = ", ".join(f"carray({name}, {sized(shape)})" for name, _, shape in method.arguments)
    call = f"{called}(Parameters({', '.join(_rebuilt(plugin, 'parameters' if width == 1 else 'whole'))}), {arrays})"
    return f"fill(carray(result, {sized(method.result)}), {call})" if method.result else f"return {call}"


def _fill(result: FloatArray, given: FloatArray) -> None:
    """Write a matrix; NumPy's own assignment checks for overlaps and takes longer than a small adaptation."""
    if given.shape != result.shape:
        raise ValueError("a method returned an array of another shape than it should")
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = given[i, j]


def _attributes(plugin: object) -> list[tuple[str, Any]]:
    """The fields, then the plain constants of the class."""
    names, constants = _attributes_of(type(plugin))  # type: ignore[arg-type]  # mypy takes a type for no key
    return [*((name, getattr(plugin, name)) for name in names), *constants]


@lru_cache(maxsize=256)
def _attributes_of(cls: type[Any]) -> tuple[list[str], list[tuple[str, Any]]]:
    """Names of the fields, and the constants with their values."""
    fields = [field.name for field in dataclasses.fields(cls)]
    constants = {
        name: value
        for base in reversed(cls.__mro__)
        for name, value in vars(base).items()
        if not name.startswith("_") and name not in fields and _is_constant(value)
    }
    return fields, sorted(constants.items())


def _is_constant(value: object) -> bool:
    return isinstance(value, (bool, int, float, str)) or (isinstance(value, tuple) and all(map(_is_constant, value)))


def _flat(value: object) -> list[float]:
    if isinstance(value, (tuple, list)):
        return [number for item in value for number in _flat(item)]
    return [value] if isinstance(value, (bool, int, float)) else []


def _rebuilt(plugin: object, whole: str) -> list[str]:
    """Source text that makes each attribute from the vector of numbers; what is no number is written out.

    ``whole``: where the numbers of whole numbers stand, but for those that vary between runs.
    """
    place, apart = iter(range(10**6)), _varying(plugin) if whole != "parameters" else ()
    return [_text(value, place, "" if name in apart else whole) for name, value in _attributes(plugin)]


def _text(value: object, place: Iterator[int], whole: str) -> str:
    if isinstance(value, (tuple, list)):
        items = "".join(f"{_text(item, place, whole)}, " for item in value)
        return f"({items})"
    if isinstance(value, float) or (isinstance(value, int) and not whole):
        return f"parameters[{next(place)}]"
    if isinstance(value, bool):
        return f"{whole}[{next(place)}] != 0"
    if isinstance(value, int):
        return f"int({whole}[{next(place)}])"
    return repr(value)
