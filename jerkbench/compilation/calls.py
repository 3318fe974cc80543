"""Calls of compiled functions by their address: a caller that is kept on the disk cannot know them by name.

numba's own way, an argument of type FunctionType, takes 30 us for each function when Python hands it over, and each
array some ten registers in a call. Here a function is a number, and an array the address of its first element.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def fill_by(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """Call the function at ``address``, which returns nothing, with the data of ``arrays`` and with ``numbers``."""
    return _call(types.void, address, arrays, numbers)


@intrinsic
def ask(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """Likewise a function that returns a number."""
    return _call(types.float64, address, arrays, numbers)


@intrinsic
def try_fill_by(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """The same as `fill_by`, but an error of the function stops there; return whether there was none."""
    return _call(types.void, address, arrays, numbers, guarded=types.boolean)


@intrinsic
def try_ask(_typing: Any, address: Any, arrays: Any, numbers: Any) -> Any:  # noqa: ANN401 - as above
    """The same as `ask`; return whether there was no error, and the number."""
    return _call(types.float64, address, arrays, numbers, guarded=types.Tuple([types.boolean, types.float64]))


def _call(result: Any, address: Any, arrays: Any, numbers: Any, guarded: Any = None) -> Any:  # noqa: ANN401 - as above
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
