"""Methods of a plugin, compiled as they are, and called by their address."""

import dataclasses
import re
from collections import namedtuple
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from jerkbench.arrays import FloatArray
from jerkbench.compilation.code_digest import digest, own_function
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry

# Calls of compiled functions by their address: a caller that is kept on the disk cannot know them by name.
#
# numba's own way, an argument of type FunctionType, takes 30 us for each function when Python hands it over, and each
# array some ten registers in a call. Here a function is a number, and an array the address of its first element.


@intrinsic
def fill_by(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """Call the function at ``address``, which returns nothing, with the data of ``arrays`` and with ``numbers``."""
    return _call_at(types.void, address, arrays, numbers)


@intrinsic
def ask(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """Likewise a function that returns a number."""
    return _call_at(types.float64, address, arrays, numbers)


@intrinsic
def try_fill_by(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """The same as `fill_by`, but an error of the function stops there; return whether there was none."""
    return _call_at(types.void, address, arrays, numbers, guarded=types.boolean)


@intrinsic
def try_ask(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """The same as `ask`; return whether there was no error, and the number."""
    return _call_at(types.float64, address, arrays, numbers, guarded=types.Tuple([types.boolean, types.float64]))


def _call_at(result: Any, address: Any, arrays: Any, numbers: Any, guarded: Any = None) -> Any:  # noqa: ANN401 - as above
    """Typing and code of a call in numba's convention.

    An error that the function raises goes on to the caller's, unless the type ``guarded`` has room to say so.
    """
    takes = [types.CPointer(array.dtype) for array in arrays] + list(numbers)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        given = cgutils.unpack_tuple(builder, args[1], len(arrays))
        values = [context.make_array(t)(context, builder, value).data for t, value in zip(arrays, given, strict=True)]
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


# Methods of a plugin, compiled as they are: `self` becomes a named tuple that is rebuilt from a vector of numbers.


class Method(NamedTuple):
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
    return np.array([number for _, value in _attributes(plugin) for number in _numbers(value)], dtype=np.float64)


def compiled_method(plugin: object, method: Method) -> Any:  # noqa: ANN401 - numba has no types
    """Return the plugin's method as a compiled function for `jerkbench.compilation.methods`.

    It takes the addresses of the parameters, of each argument, and of the array that it fills if there is one; then
    the sizes. One compilation serves all values of the numeric parameters.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        numba.core.errors.UnsupportedBytecodeError: likewise; it is no NumbaError.
        TypeError: the method is no plain function.
    """
    function = own_function(getattr(type(plugin), method.name, None))
    if function is None:
        raise TypeError(f"{type(plugin).__name__}.{method.name} is not a plain function")
    fields = [name for name, _ in _attributes(plugin)]
    source = _entry_source(plugin, method)

    def namespace(home: str) -> dict[str, Any]:
        """Return what the entry point's text refers to."""
        return {
            "Parameters": namedtuple("Parameters", fields),  # noqa: PYI024 - its fields are known at run time only
            "method": jitted(function, home),
            "fill": jitted(_fill, home),
        }

    title = f"{type(plugin).__name__}.{method.name}"
    module: ModuleType = load_entry(title, source, digest(function, fields=fields), namespace)
    return module.entry


def address_of(function: Any) -> int:  # noqa: ANN401 - numba has no types
    """Return the address of a compiled ``function`` that has one signature."""
    (compiled,) = function.overloads.values()
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


ENTRY = '''"""Made by jerkbench: {title} for compiled code."""

from numba import carray, njit
from numba.types import CPointer, float64, int64, void


@njit({result}({types}), cache=True, error_model="numpy", nogil=True)
def entry({names}):
{body}
'''

BODY = """\
    if {usual}:  # with constant sizes its loops are unrolled
        {often}
    else:
        {else_}"""


def _entry_source(plugin: object, method: Method) -> str:
    """Text of the entry point: rebuild self, call the method."""
    arrays = [("parameters", "float64"), *(argument[:2] for argument in method.arguments)]
    arrays += [("result", "float64")] if method.result else []
    return ENTRY.format(
        title=f"{type(plugin).__name__}.{method.name}",
        result="void" if method.result else "float64",
        types=", ".join([f"CPointer({of})" for _, of in arrays] + ["int64"] * len(method.sizes)),
        names=", ".join([name for name, _ in arrays] + list(method.sizes)),
        body=_body(plugin, method),
    )


def _body(plugin: object, method: Method) -> str:
    """Text of the call; of two where some sizes are usual."""
    if not method.usual:
        return f"    {_call(plugin, method, {})}"
    return BODY.format(
        usual=" and ".join(f"{name} == {size}" for name, size in method.usual),
        often=_call(plugin, method, dict(method.usual)),
        else_=_call(plugin, method, {}),
    )


def _call(plugin: object, method: Method, known: dict[str, int]) -> str:
    """Text of the call, with numbers in the place of the sizes that are ``known``."""

    def sized(shape: str) -> str:
        names = {name: str(known.get(name, name)) for name in method.sizes}
        return "".join(names.get(word, word) for word in re.split(r"(\w+)", shape))

    arrays = ", ".join(f"carray({name}, {sized(shape)})" for name, _, shape in method.arguments)
    call = f"method(Parameters({', '.join(_rebuilt(plugin))}), {arrays})"
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
