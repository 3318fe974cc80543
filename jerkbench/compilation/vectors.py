"""Vectors of numbers for compiled code: one number of each of several runs, which the processor works on at once.

Kernels are written for numbers. Given a `jerkbench.compilation.views.Lanes` of several runs they work on all of them
side by side, because numba compiles a function anew for each type of its arguments. Two things have to be said
differently: a choice between two values, and the largest (`chosen`). A vector of one number is that number.
"""

import math
import operator
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numba.np.arrayobj import populate_array

from jerkbench.arrays import WIDE, FloatArray

NUMBER, INDEX, LONG = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
"""As LLVM knows them."""


class Vector(types.Type):
    """A vector of ``width`` numbers; a number turns into one by repetition."""

    def __init__(self, width: int) -> None:
        """Name the type after its width."""
        self.width = width
        super().__init__(name=f"vector{width}")

    def unify(self, _: Any, other: Any) -> Any:  # noqa: ANN401 - numba has no types
        """Return what both are."""
        return self if isinstance(other, types.Float | types.Integer) else None

    def can_convert_from(self, _: Any, other: Any) -> Any:  # noqa: ANN401 - numba has no types
        """Take a number where a vector belongs."""
        from numba.core.typeconv import Conversion

        return Conversion.promote if isinstance(other, types.Float | types.Integer) else None


@cache
def vector_of(width: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return numba's type of a vector of ``width`` numbers."""
    return types.float64 if width == 1 else Vector(width)


def llvm_vector(width: int) -> Any:  # noqa: ANN401 - llvmlite has no types
    """Return LLVM's type of a vector of ``width`` numbers."""
    return NUMBER if width == 1 else ir.VectorType(NUMBER, width)


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    """In memory it is packed: numba's arrays begin anywhere, and LLVM takes a plain vector to begin at 64 bytes."""

    def __init__(self, manager: Any, of: Any) -> None:  # noqa: ANN401 - numba has no types
        super().__init__(manager, of, llvm_vector(of.width))

    def get_data_type(self) -> Any:  # noqa: ANN401 - llvmlite has no types
        return ir.LiteralStructType([self.get_value_type()], packed=True)

    def as_data(self, builder: Any, value: Any) -> Any:  # noqa: ANN401 - as above
        return builder.insert_value(ir.Constant(self.get_data_type(), ir.Undefined), value, 0)

    def from_data(self, builder: Any, value: Any) -> Any:  # noqa: ANN401 - as above
        return builder.extract_value(value, 0)


def repeated(builder: Any, number: Any, width: int) -> Any:  # noqa: ANN401 - llvmlite has no types
    """Return a vector that holds ``number`` ``width`` times."""
    nothing = ir.Constant(llvm_vector(width), ir.Undefined)
    first = builder.insert_element(nothing, number, ir.Constant(INDEX, 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(INDEX, width), [0] * width))


@lower_cast(types.Float, Vector)
def _cast(_context: Any, builder: Any, _from: Any, to: Any, number: Any) -> Any:  # noqa: ANN401 - as above
    return repeated(builder, number, to.width)


@lower_cast(types.Integer, Vector)
def _cast_integer(context: Any, builder: Any, of: Any, to: Any, number: Any) -> Any:  # noqa: ANN401 - as above
    return repeated(builder, context.cast(builder, number, of, types.float64), to.width)


def _common(kinds: Any) -> Any:  # noqa: ANN401 - as above
    """The type of a result of ``kinds``: a vector if one of them is, or None if they are of several widths."""
    wide = {kind for kind in kinds if isinstance(kind, Vector)}
    return wide.pop() if len(wide) == 1 else None if wide else types.float64


_PAIRS = (
    *((Vector, kind) for kind in (Vector, types.Float, types.Integer)),
    *((kind, Vector) for kind in (types.Float, types.Integer)),
)
"""Kinds of two values of which one is a vector."""


def _define(symbols: tuple[Any, ...], instruction: str) -> None:
    """Teach numba an operator between vectors, and between a vector and a number."""
    flags = ("contract",)

    def generic(_self: Any, args: Any, _kws: Any) -> Any:  # noqa: ANN401 - as above
        """Return the types of the operator, or None where it is not between vectors."""
        known = len(args) == 2 and all(isinstance(arg, Vector | types.Float | types.Integer) for arg in args)
        result = _common(args) if known else None
        return signature(result, *args) if isinstance(result, Vector) else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Return the LLVM instruction; a number is repeated over the width."""
        both = [context.cast(builder, x, kind, sig.return_type) for kind, x in zip(sig.args, args, strict=True)]
        return getattr(builder, instruction)(*both, flags=flags)

    for symbol in symbols:
        infer_global(symbol)(type("_Operator", (AbstractTemplate,), {"key": symbol, "generic": generic}))
        for pair in _PAIRS:
            lower_builtin(symbol, *pair)(lower)


_define((operator.add, operator.iadd), "fadd")
_define((operator.sub, operator.isub), "fsub")
_define((operator.mul, operator.imul), "fmul")
_define((operator.truediv, operator.itruediv), "fdiv")


@intrinsic
def chosen(_typing: Any, left: Any, right: Any, yes: Any, no: Any) -> Any:  # noqa: ANN401 - as above
    """``yes`` where left > right, else ``no`` (also where one of them is NaN): of numbers, or in each run."""
    result = _common((left, right, yes, no))

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        given = [context.cast(builder, arg, t, result) for t, arg in zip(sig.args, args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", given[0], given[1]), given[2], given[3])

    return (result(left, right, yes, no), generate) if result else None


# What plain functions of a number may call (`jerkbench.compilation.lanes`).


def _teach(function: Any, takes: int, write: Any) -> None:  # noqa: ANN401 - as above
    """Teach numba a function of ``takes`` vectors or numbers; ``write`` gets the builder and the vectors."""

    def generic(_self: Any, args: Any, _kws: Any) -> Any:  # noqa: ANN401 - as above
        """Return the types of the function, or None where it gets no vector."""
        known = len(args) == takes and all(isinstance(arg, Vector | types.Float | types.Integer) for arg in args)
        result = _common(args) if known else None
        return signature(result, *args) if isinstance(result, Vector) else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        of = sig.return_type
        return write(builder, *(context.cast(builder, x, t, of) for x, t in zip(args, sig.args, strict=True)))

    infer_global(function)(type("_Function", (AbstractTemplate,), {"key": function, "generic": generic}))
    for kinds in _PAIRS if takes == 2 else ((Vector,),):
        lower_builtin(function, *kinds)(lower)


def _intrinsic(name: str) -> Any:  # noqa: ANN401 - as above
    def write(builder: Any, x: Any) -> Any:  # noqa: ANN401 - as above
        """Call the intrinsic of LLVM for vectors."""
        of = ir.FunctionType(x.type, [x.type])
        return builder.call(cgutils.get_or_insert_function(builder.module, of, f"llvm.{name}.v{x.type.count}f64"), [x])

    return write


def _larger(builder: Any, a: Any, b: Any) -> Any:  # noqa: ANN401 - as above
    return builder.select(builder.fcmp_ordered(">", b, a), b, a)


def _smaller(builder: Any, a: Any, b: Any) -> Any:  # noqa: ANN401 - as above
    return builder.select(builder.fcmp_ordered("<", b, a), b, a)


LN2_HIGH, LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
"""ln 2 in two parts, the first with so many zeros at its end that up to 1024 times it is exact."""

WHOLE_ABOVE = 1.5 * 2.0**52
"""Added to a number it leaves its nearest whole number in the last bits."""

MIN_EXPONENT, MAX_EXPONENT = -708.0, 709.79
"""Below the one the exponential is less than any normal number, above the other it is infinite."""


def _exp(builder: Any, x: Any) -> Any:  # noqa: ANN401 - as above
    """2^n e^r with x = n ln 2 + r, |r| <= ln 2 / 2: e^r by its series. LLVM would call a library for each number.

    Below `MIN_EXPONENT` it is 0. The 14th term is less than 1e-17.
    """

    def number(value: float) -> Any:  # noqa: ANN401 - as above
        return ir.Constant(x.type, [value] * x.type.count)

    def plus(a: Any, b: Any, c: Any) -> Any:  # noqa: ANN401 - as above
        """Return the product of the first two, and the third."""
        return builder.fadd(builder.fmul(a, b, flags=("contract",)), c, flags=("contract",))

    bits = ir.VectorType(LONG, x.type.count)
    shifted = plus(x, number(1.0 / math.log(2.0)), number(WHOLE_ABOVE))
    n = builder.fsub(shifted, number(WHOLE_ABOVE))
    r = plus(n, number(-LN2_LOW), plus(n, number(-LN2_HIGH), x))
    series = number(1.0 / math.factorial(13))
    for k in range(12, -1, -1):
        series = plus(series, r, number(1.0 / math.factorial(k)))
    power = builder.shl(builder.bitcast(shifted, bits), ir.Constant(bits, [52] * x.type.count))
    result = builder.bitcast(builder.add(builder.bitcast(series, bits), power), x.type)
    result = builder.select(builder.fcmp_ordered("<", x, number(MIN_EXPONENT)), number(0.0), result)
    result = builder.select(builder.fcmp_ordered(">", x, number(MAX_EXPONENT)), number(math.inf), result)
    return builder.select(builder.fcmp_ordered("==", x, x), result, x)


_teach(abs, 1, _intrinsic("fabs"))
_teach(math.sqrt, 1, _intrinsic("sqrt"))
_teach(math.exp, 1, _exp)
_teach(max, 2, _larger)
_teach(min, 2, _smaller)
_teach(operator.neg, 1, lambda builder, x: builder.fneg(x))


@intrinsic
def anywhere(_typing: Any, flag: Any) -> Any:  # noqa: ANN401 - as above
    """Whether a number is above zero in any of the runs."""

    def generate(_context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        above = builder.fcmp_ordered(">", args[0], ir.Constant(args[0].type, None))
        if sig.args[0] == types.float64:
            return above
        bits = ir.IntType(sig.args[0].width)
        return builder.icmp_unsigned("!=", builder.bitcast(above, bits), bits(0))

    return (types.boolean(flag), generate) if isinstance(flag, Vector | types.Float) else None


# What is asked of each run by itself (`jerkbench.compilation.lanes.each_run`).


@intrinsic
def of_run(_typing: Any, values: Any, k: Any) -> Any:  # noqa: ANN401 - as above
    """What run ``k`` has of a tuple: a number of a vector, a column of an array of vectors; all else is shared."""
    kinds = types.Tuple([_of_one(kind) for kind in values])

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        place = context.cast(builder, args[1], sig.args[1], types.intp)
        parts = zip(cgutils.unpack_tuple(builder, args[0]), sig.args[0], sig.return_type, strict=True)
        return context.make_tuple(builder, kinds, [_part(context, builder, place, *part) for part in parts])

    return kinds(values, k), generate


def _of_one(kind: Any) -> Any:  # noqa: ANN401 - as above
    if isinstance(kind, types.Array) and isinstance(kind.dtype, Vector):
        return types.Array(types.float64, kind.ndim, "A")
    return types.float64 if isinstance(kind, Vector) else kind


def _part(context: Any, builder: Any, place: Any, value: Any, kind: Any, of_one: Any) -> Any:  # noqa: ANN401 - as above
    if kind is of_one:
        return value
    if isinstance(kind, Vector):
        return builder.extract_element(value, place)
    whole, column = context.make_array(kind)(context, builder, value), context.make_array(of_one)(context, builder)
    first = builder.gep(builder.bitcast(whole.data, NUMBER.as_pointer()), [place])
    populate_array(column, first, whole.shape, whole.strides, context.get_constant(types.intp, 8), None)
    return column._getvalue()  # noqa: SLF001 - numba's own way


@intrinsic
def with_number(_typing: Any, vector: Any, k: Any, number: Any) -> Any:  # noqa: ANN401 - as above
    """``vector`` with the ``number`` of run ``k``."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        place = context.cast(builder, args[1], sig.args[1], types.intp)
        return builder.insert_element(args[0], context.cast(builder, args[2], sig.args[2], types.float64), place)

    return vector(vector, k, number), generate


def each_run(function: Any, *given: Any) -> Any:  # noqa: ANN401 - as above
    """``function(*given)``, a number, of each run by itself; the last that is given is a number too."""
    answer = given[-1]
    for k in range(WIDE):
        answer = with_number(answer, k, function(*of_run(given, k)))
    return answer


def turned(builder: Any, rows: Any) -> Any:  # noqa: ANN401 - as above
    """Return eight vectors of eight numbers each, the number of a row exchanged with that of a column, bit by bit."""
    for bit in (1, 2, 4):
        low = [k if not k & bit else WIDE + (k ^ bit) for k in range(WIDE)]
        high = [k | bit if not k & bit else WIDE + k for k in range(WIDE)]
        masks = [ir.Constant(ir.VectorType(INDEX, WIDE), mask) for mask in (low, high)]
        pairs = [(rows[k & ~bit], rows[k | bit], masks[bool(k & bit)]) for k in range(WIDE)]
        rows = [builder.shuffle_vector(*pair) for pair in pairs]
    return rows


def aligned_zeros(*shape: int) -> FloatArray:
    """Return zeros that begin with a line of the cache; vectors that lie across two are slow."""
    return _from_a_line(np.zeros(math.prod(shape) + WIDE), shape)


def aligned_room(*shape: int) -> FloatArray:
    """Return room that begins with a line of the cache; what is in it means nothing."""
    return _from_a_line(np.empty(math.prod(shape) + WIDE), shape)


def _from_a_line(whole: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    first = -(whole.__array_interface__["data"][0] // whole.itemsize) % WIDE
    return whole[first : first + math.prod(shape)].reshape(shape)  # NumPy takes ten times as long for a product
