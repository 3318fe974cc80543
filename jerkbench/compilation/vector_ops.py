"""How vectors of compiled code move: their numbers among each other, and they to registers and from the memory."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from jerkbench.compilation.vectors import INDEX, NUMBER, VECTOR, WIDTH, address_in, vector_type, vectors_type


@intrinsic
def scratch(_typing: Any, number: Any) -> Any:  # noqa: ANN401 - numba has no types
    """Room for ``number`` vectors (a constant) until the function returns; what never leaves it needs no memory."""

    def generate(_context: Any, builder: Any, _sig: Any, _args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        room = cgutils.alloca_once(builder, ir.ArrayType(VECTOR, number.literal_value))
        return builder.bitcast(room, NUMBER.as_pointer())

    return (vectors_type(number), generate) if isinstance(number, types.IntegerLiteral) else None


@intrinsic
def picked(_typing: Any, a: Any, b: Any, c: Any, d: Any, places: Any) -> Any:  # noqa: ANN401 - as above
    """A vector of numbers of four: of ``a`` where ``places`` (a constant) has 0 to WIDTH - 1, then of b, and so on."""
    if not all(isinstance(place, types.IntegerLiteral) for place in places):
        return None  # numba asks again with the constants

    def generate(_context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        numbers = [place.literal_value for place in sig.args[4]]
        joined = [ir.Constant(ir.VectorType(INDEX, 2 * WIDTH), list(range(2 * WIDTH)))]
        halves = [builder.shuffle_vector(args[k], args[k + 1], *joined) for k in (0, 2)]
        return builder.shuffle_vector(*halves, ir.Constant(ir.VectorType(INDEX, WIDTH), numbers))

    return vector_type(a, b, c, d, places), generate


@intrinsic
def fetch(_typing: Any, array: Any, index: Any) -> Any:  # noqa: ANN401 - as above
    """Ask for vector ``index``, which may lie beyond the end, long before it is read: memory is slow to answer."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        kind, byte = ir.IntType(32), ir.IntType(8).as_pointer()
        ask = builder.module.declare_intrinsic(
            "llvm.prefetch", (byte,), ir.FunctionType(ir.VoidType(), [byte, *[kind] * 3])
        )
        place = address_in(builder, args[0], context.cast(builder, args[1], sig.args[1], types.intp))
        builder.call(ask, [builder.bitcast(place, byte), kind(0), kind(3), kind(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


@intrinsic
def transpose(_typing: Any, into: Any, at: Any, step: Any, rows: Any) -> Any:  # noqa: ANN401 - as above
    """Write number k of each of WIDTH vectors ``rows`` into vector ``at + k step`` of ``into``, for all k."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ANN401 - as above
        """Write it in LLVM."""
        turned = _turned(builder, cgutils.unpack_tuple(builder, args[3], WIDTH))
        first, step = (context.cast(builder, args[k], sig.args[k], types.intp) for k in (1, 2))
        for k, row in enumerate(turned):
            index = builder.add(first, builder.mul(step, ir.Constant(step.type, k)))
            builder.store(row, address_in(builder, args[0], index)).align = 8
        return context.get_dummy_value()

    return types.void(into, at, step, rows), generate


def _turned(builder: Any, rows: Any) -> Any:  # noqa: ANN401 - as above
    """Exchange bit by bit the number of a row with that of a column."""
    for bit in (1, 2, 4):
        low = [k if not k & bit else WIDTH + (k ^ bit) for k in range(WIDTH)]
        high = [k | bit if not k & bit else WIDTH + k for k in range(WIDTH)]
        masks = [ir.Constant(ir.VectorType(INDEX, WIDTH), mask) for mask in (low, high)]
        pairs = [(rows[k & ~bit], rows[k | bit], masks[bool(k & bit)]) for k in range(WIDTH)]
        rows = [builder.shuffle_vector(*pair) for pair in pairs]
    return rows
