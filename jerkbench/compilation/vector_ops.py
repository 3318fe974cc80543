"""The moves of vectors in compiled code: numbers among each other, to registers, from the memory."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from jerkbench.compilation.vectors import INDEX, NUMBER, WIDE, address_in, llvm_vector, vector_of, vectors_of

BLOCK = 8
"""Numbers of a run that `scatter` and `gather` move at once."""


@intrinsic
def scratch(_typing: Any, number: Any, width: Any) -> Any:  # noqa: ANN401 - numba has no types
    """Room for ``number`` vectors of ``width`` (constants) until the function returns.

    What never leaves the function needs no memory.
    """

    def generate(_context: Any, builder: Any, _sig: Any, _args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        room = cgutils.alloca_once(builder, ir.ArrayType(llvm_vector(width.literal_value), number.literal_value))
        return builder.bitcast(room, NUMBER.as_pointer())

    if isinstance(number, types.IntegerLiteral) and isinstance(width, types.IntegerLiteral):
        return vectors_of(width.literal_value)(number, width), generate
    return None  # numba asks again with the constants


@intrinsic
def picked(_typing: Any, a: Any, b: Any, c: Any, d: Any, places: Any) -> Any:  # noqa: ANN401 - as above
    """A vector of numbers of four: of ``a`` where ``places`` (a constant) has 0 to 7, then of b, and so on."""
    if not all(isinstance(place, types.IntegerLiteral) for place in places):
        return None  # numba asks again with the constants

    def generate(_context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        numbers = [place.literal_value for place in sig.args[4]]
        joined = [ir.Constant(ir.VectorType(INDEX, 2 * WIDE), list(range(2 * WIDE)))]
        halves = [builder.shuffle_vector(args[k], args[k + 1], *joined) for k in (0, 2)]
        return builder.shuffle_vector(*halves, ir.Constant(ir.VectorType(INDEX, WIDE), numbers))

    return vector_of(WIDE)(a, b, c, d, places), generate


@intrinsic
def fetch(_typing: Any, array: Any, index: Any) -> Any:  # noqa: ANN401 - as above
    """Ask for vector ``index``, which may lie beyond the end, long before it is read: memory is slow to answer."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        kind, byte = ir.IntType(32), ir.IntType(8).as_pointer()
        ask = builder.module.declare_intrinsic(
            "llvm.prefetch", (byte,), ir.FunctionType(ir.VoidType(), [byte, *[kind] * 3])
        )
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        place = address_in(builder, args[0], at, sig.args[0].width)
        builder.call(ask, [builder.bitcast(place, byte), kind(0), kind(3), kind(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


@intrinsic
def scatter(_typing: Any, into: Any, at: Any, step: Any, rows: Any) -> Any:  # noqa: ANN401 - as above
    """Write BLOCK vectors ``rows`` run by run: number k of each into block ``at + k step`` of ``into``, for all k."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        rows = cgutils.unpack_tuple(builder, args[3], BLOCK)
        first, step = (context.cast(builder, args[k], sig.args[k], types.intp) for k in (1, 2))
        if sig.args[0].width == 1:
            places = [builder.add(builder.mul(first, first.type(BLOCK)), first.type(k)) for k in range(BLOCK)]
        else:
            rows = _turned(builder, rows)
            places = [builder.add(first, builder.mul(step, step.type(k))) for k in range(BLOCK)]
        for row, place in zip(rows, places, strict=True):
            builder.store(row, address_in(builder, args[0], place, sig.args[0].width)).align = 8
        return context.get_dummy_value()

    return types.void(into, at, step, rows), generate


@intrinsic
def gather(_typing: Any, given: Any, at: Any, step: Any) -> Any:  # noqa: ANN401 - as above
    """Return BLOCK vectors from where each run has its own: the reverse of `scatter`."""
    result = types.UniTuple(given.element, BLOCK)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        first, step = (context.cast(builder, args[k], sig.args[k], types.intp) for k in (1, 2))
        width = sig.args[0].width
        if width == 1:
            places = [builder.add(builder.mul(first, first.type(BLOCK)), first.type(k)) for k in range(BLOCK)]
        else:
            places = [builder.add(first, builder.mul(step, step.type(k))) for k in range(BLOCK)]
        rows = [builder.load(address_in(builder, args[0], place, width)) for place in places]
        for row in rows:
            row.align = 8
        return context.make_tuple(builder, result, rows if width == 1 else _turned(builder, rows))

    return result(given, at, step), generate


def _turned(builder: Any, rows: Any) -> Any:  # noqa: ANN401 - as above
    """Exchange bit by bit the number of a row with that of a column."""
    for bit in (1, 2, 4):
        low = [k if not k & bit else WIDE + (k ^ bit) for k in range(WIDE)]
        high = [k | bit if not k & bit else WIDE + k for k in range(WIDE)]
        masks = [ir.Constant(ir.VectorType(INDEX, WIDE), mask) for mask in (low, high)]
        pairs = [(rows[k & ~bit], rows[k | bit], masks[bool(k & bit)]) for k in range(WIDE)]
        rows = [builder.shuffle_vector(*pair) for pair in pairs]
    return rows
