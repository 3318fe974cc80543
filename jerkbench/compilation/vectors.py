"""Vectors of numbers for compiled code: one number of each of WIDTH runs, which the processor works on at once.

Kernels are written for numbers. Given an array of vectors (`vectors`) in the place of an array of numbers they work on
WIDTH runs side by side, because numba compiles a function anew for each type of its arguments. Two things have
to be said differently: a choice between two values (`chosen`), and the largest (`larger`).
"""

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

from jerkbench.arrays import FloatArray

WIDTH = 8
"""Numbers in a vector: 512 bits, one or a few registers on every processor."""

NUMBER, INDEX = ir.DoubleType(), ir.IntType(32)
VECTOR = ir.VectorType(NUMBER, WIDTH)
"""As LLVM knows them."""


class _Vector(types.Type):
    """A vector; a number turns into one by repetition."""

    def __init__(self) -> None:
        super().__init__(name=f"vector{WIDTH}")

    def unify(self, _: Any, other: Any) -> Any:  # noqa: ANN401 - numba has no types
        return self if isinstance(other, types.Float) else None

    def can_convert_from(self, _: Any, other: Any) -> Any:  # noqa: ANN401 - numba has no types
        """Take a number where a vector belongs."""
        from numba.core.typeconv import Conversion

        return Conversion.promote if isinstance(other, types.Float) else None


class _Vectors(types.Type):
    """An array of vectors: the address of its first number."""

    def __init__(self) -> None:
        super().__init__(name=f"vectors{WIDTH}")


vector_type, vectors_type = _Vector(), _Vectors()


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:  # noqa: ANN401 - numba has no types
        super().__init__(manager, of, VECTOR)


@register_model(_Vectors)
class _VectorsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:  # noqa: ANN401 - numba has no types
        super().__init__(manager, of, NUMBER.as_pointer())


def _repeated(builder: Any, number: Any) -> Any:  # noqa: ANN401 - llvmlite has no types
    one = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), number, ir.Constant(INDEX, 0))
    everywhere = ir.Constant(ir.VectorType(INDEX, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(VECTOR, ir.Undefined), everywhere)


@lower_cast(types.Float, _Vector)
def _cast(_context: Any, builder: Any, _from: Any, _to: Any, number: Any) -> Any:  # noqa: ANN401 - as above
    return _repeated(builder, number)


def _define(symbols: tuple[Any, ...], instruction: str) -> None:
    """Teach numba an operator between vectors, and between a vector and a number."""

    def generic(_self: Any, args: Any, _kws: Any) -> Any:  # noqa: ANN401 - as above
        known = all(arg is vector_type or isinstance(arg, types.Float) for arg in args)
        return signature(vector_type, *args) if len(args) == 2 and vector_type in args and known else None

    def lower(_context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        both = [x if t is vector_type else _repeated(builder, x) for t, x in zip(sig.args, args, strict=True)]
        return getattr(builder, instruction)(*both, flags=("contract",))

    for symbol in symbols:
        infer_global(symbol)(type("_Operator", (AbstractTemplate,), {"key": symbol, "generic": generic}))
        for pair in ((_Vector, _Vector), (_Vector, types.Float), (types.Float, _Vector)):
            lower_builtin(symbol, *pair)(lower)


_define((operator.add, operator.iadd), "fadd")
_define((operator.sub, operator.isub), "fsub")
_define((operator.mul, operator.imul), "fmul")
_define((operator.truediv, operator.itruediv), "fdiv")


def address_in(builder: Any, first: Any, index: Any) -> Any:  # noqa: ANN401 - as above
    """Return the address of vector ``index``, in LLVM."""
    place = builder.gep(first, [builder.mul(index, ir.Constant(index.type, WIDTH))])
    return builder.bitcast(place, VECTOR.as_pointer())


@infer_global(operator.getitem)
class _Get(AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:  # noqa: ANN401 - as above
        mine = args[0] is vectors_type and isinstance(args[1], types.Integer)
        return signature(vector_type, vectors_type, types.intp) if mine else None


@lower_builtin(operator.getitem, _Vectors, types.Integer)
def _load(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
    loaded = builder.load(address_in(builder, *args))
    loaded.align = 8
    return loaded


@infer_global(operator.setitem)
class _Set(AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:  # noqa: ANN401 - as above
        mine = args[0] is vectors_type and isinstance(args[1], types.Integer)
        return signature(types.none, vectors_type, types.intp, vector_type) if mine else None


@lower_builtin(operator.setitem, _Vectors, types.Integer, _Vector)
def _store(context: Any, builder: Any, _sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
    builder.store(args[2], address_in(builder, args[0], args[1])).align = 8
    return context.get_dummy_value()


@intrinsic
def vectors(_typing: Any, array: Any) -> Any:  # noqa: ANN401 - as above
    """See a contiguous array of numbers as vectors: number l of vector k is element WIDTH k + l. Keep it alive."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        return context.make_array(sig.args[0])(context, builder, args[0]).data

    return vectors_type(array), generate


@intrinsic
def chosen(_typing: Any, left: Any, right: Any, yes: Any, no: Any) -> Any:  # noqa: ANN401 - as above
    """``yes`` where left > right, else ``no`` (also where one of them is NaN): of numbers, or in each run."""
    result = vector_type if vector_type in (left, right, yes, no) else types.float64

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        given = [context.cast(builder, arg, t, result) for t, arg in zip(sig.args, args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", given[0], given[1]), given[2], given[3])

    return result(left, right, yes, no), generate


def aligned_zeros(length: int) -> FloatArray:
    """Return zeros that begin with a line of the cache; vectors that lie across two are slow."""
    whole = np.zeros(length + WIDTH)
    first = -(whole.ctypes.data // whole.itemsize) % WIDTH
    return whole[first : first + length]
