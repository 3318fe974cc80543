"""Extensions of numba: vectors with one number for each of eight runs, and a compiler for inner functions.

The kernels are written for scalar numbers. numba compiles a function separately for each combination of argument types,
so a kernel that receives arrays of vectors (`in_lanes`) processes eight runs at the same time. Only the branches of a
kernel have to be replaced. The function `select` selects one of two values in each run, and `anywhere` returns whether
a number is positive in any run.
"""

import math
import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv import Conversion
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numba.np.arrayobj import getitem_array_tuple, getitem_arraynd_intp, populate_array

from jerkbench.arrays import WIDE, FloatArray
from jerkbench.compilation import lanes

NUMBER, INDEX = ir.DoubleType(), ir.IntType(32)
WIDE_NUMBER = ir.VectorType(NUMBER, WIDE)
"""LLVM type of a vector. `NUMBER` and `INDEX` are the LLVM types of an element and of its index."""

Untyped = Any
"""Annotation of objects of numba and llvmlite, because these packages have no type annotations."""


class Vector(types.Type):
    """The numba type of a vector of eight numbers. A number is converted to a vector by repetition."""

    def __init__(self) -> None:
        super().__init__(name=f"vector{WIDE}")
        self.bitwidth = 64 * WIDE

    def unify(self, _: Untyped, other: Untyped) -> Untyped:
        """Return the common type of a vector and a number, which is the vector type."""
        return self if isinstance(other, types.Float | types.Integer) else None

    def can_convert_from(self, _: Untyped, other: Untyped) -> Untyped:
        """Allow the implicit conversion of a number to a vector."""
        return Conversion.promote if isinstance(other, types.Float | types.Integer) else None


LANES = Vector()


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    """The memory layout of a vector. The layout is packed, because numba arrays are not always aligned to 64 bytes."""

    def __init__(self, manager: Untyped, of: Untyped) -> None:
        super().__init__(manager, of, WIDE_NUMBER)

    def get_data_type(self) -> Untyped:
        return ir.LiteralStructType([self.get_value_type()], packed=True)

    def as_data(self, builder: Untyped, value: Untyped) -> Untyped:
        return builder.insert_value(ir.Constant(self.get_data_type(), ir.Undefined), value, 0)

    def from_data(self, builder: Untyped, value: Untyped) -> Untyped:
        return builder.extract_value(value, 0)


@lower_cast(types.Float, Vector)
@lower_cast(types.Integer, Vector)
def _repeated(context: Untyped, builder: Untyped, of: Untyped, _to: Untyped, number: Untyped) -> Untyped:
    nothing = ir.Constant(WIDE_NUMBER, ir.Undefined)
    first = builder.insert_element(nothing, context.cast(builder, number, of, types.float64), INDEX(0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(INDEX, WIDE), [0] * WIDE))


class _Record(types.Record):
    """A record type whose fields are arrays of vectors. The record type of numba supports only numbers."""

    @property
    def dtype(self) -> Untyped:
        """A NumPy type of the same size as the record."""
        return np.dtype((np.void, self.size))


register_model(_Record)(models.RecordModel)


def _in_lanes(kind: Untyped) -> Untyped:
    """Return the type of a view in which the last axis of a record or of an array is replaced by vectors."""
    if isinstance(kind, types.Record):
        fields = {name: (types.NestedArray(LANES, of.type.shape[:-1]), of.offset) for name, of in kind.fields.items()}
        placed = [(name, {"type": array, "offset": offset}) for name, (array, offset) in fields.items()]
        return _Record(placed, kind.size, kind.aligned)
    return types.Array(LANES, kind.ndim - 1, "C")


@intrinsic
def in_lanes(_typing: Untyped, numbers: Untyped) -> Untyped:
    """Return a view of an array (..., 8) of numbers as an array (...) of vectors, or of all arrays of a record."""
    kind = _in_lanes(numbers)

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        if isinstance(kind, types.Record):
            return builder.bitcast(args[0], context.get_value_type(kind))
        given = context.make_array(sig.args[0])(context, builder, args[0])
        shape, strides = (cgutils.unpack_tuple(builder, of)[:-1] for of in (given.shape, given.strides))
        return _view(context, builder, given, kind, shape, strides)

    return kind(numbers), generate


@intrinsic
def as_numbers(_typing: Untyped, vectors: Untyped) -> Untyped:
    """Return a view of an array (...) of vectors as an array (..., 8) of numbers."""
    kind = types.Array(types.float64, vectors.ndim + 1, "C")

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        given = context.make_array(sig.args[0])(context, builder, args[0])
        shape, strides = (cgutils.unpack_tuple(builder, of) for of in (given.shape, given.strides))
        last = context.get_constant(types.intp, WIDE)
        return _view(context, builder, given, kind, [*shape, last], [*strides, last])

    return kind(vectors), generate


def _view(
    context: Untyped, builder: Untyped, given: Untyped, kind: Untyped, shape: Untyped, strides: Untyped
) -> Untyped:
    element = context.get_data_type(kind.dtype)
    data, view = builder.bitcast(given.data, element.as_pointer()), context.make_array(kind)(context, builder)
    size = context.get_constant(types.intp, context.get_abi_sizeof(element))
    populate_array(view, data, shape, strides, size, given.meminfo)
    return impl_ret_borrowed(context, builder, kind, view._getvalue())  # noqa: SLF001 - as in numba


@lower_builtin(operator.getitem, types.NestedArray, types.Integer)
@lower_builtin(operator.getitem, types.NestedArray, types.UniTuple)
def _get_item(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
    """Read an element of an array in a record, with a fifth of the code that numba generates for unknown shapes."""
    kind, index = sig.args
    if sig.return_type != LANES:
        generic = getitem_arraynd_intp if isinstance(index, types.Integer) else getitem_array_tuple
        return generic(context, builder, sig, args)
    return context.unpack_value(builder, LANES, _element(context, builder, kind, index, args), 8)


@lower_builtin(operator.setitem, types.NestedArray, types.Integer, types.Any)
@lower_builtin(operator.setitem, types.NestedArray, types.UniTuple, types.Any)
def _set_item(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> None:
    kind, index, value = sig.args
    vector = context.cast(builder, args[2], value, LANES)
    context.pack_value(builder, LANES, vector, _element(context, builder, kind, index, args), 8)


@lower_builtin(len, types.NestedArray)
def _length(context: Untyped, _builder: Untyped, sig: Untyped, _args: Untyped) -> Untyped:
    """Return the length of an array in a record as a constant, so that loops over the array can be unrolled."""
    return context.get_constant(types.intp, sig.args[0].shape[0])


def _element(context: Untyped, builder: Untyped, kind: Untyped, index: Untyped, args: Untyped) -> Untyped:
    """Return the pointer to an element of an array in a record. The indices must not be negative."""
    several = isinstance(index, types.UniTuple)
    indices = cgutils.unpack_tuple(builder, args[1]) if several else [args[1]]
    integer, offset = index.dtype if several else index, context.get_constant(types.intp, 0)
    for size, value in zip(kind.shape, indices, strict=True):
        offset = builder.mul(offset, context.get_constant(types.intp, size))
        offset = builder.add(offset, context.cast(builder, value, integer, types.intp))
    data = context.data_model_manager[kind].get_field_position("data")
    return builder.gep(builder.extract_value(args[0], data), [offset])


# Operators and mathematical functions for vectors.


def _is_vector_call(args: Untyped, count: int) -> bool:
    known = len(args) == count and all(isinstance(arg, Vector | types.Float | types.Integer) for arg in args)
    return known and any(isinstance(arg, Vector) for arg in args)


_PAIRS = (
    *((Vector, kind) for kind in (Vector, types.Float, types.Integer)),
    *((kind, Vector) for kind in (types.Float, types.Integer)),
)


def _define(function: Untyped, count: int, write: Untyped) -> None:
    """Define ``function`` for ``count`` vectors or numbers, where ``write(builder, *vectors)`` generates the code."""

    def generic(_self: Untyped, args: Untyped, _kws: Untyped) -> Untyped:
        return signature(LANES, *args) if _is_vector_call(args, count) else None

    def lower(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        return write(builder, *(context.cast(builder, x, t, LANES) for x, t in zip(args, sig.args, strict=True)))

    infer_global(function)(type("_Function", (AbstractTemplate,), {"key": function, "generic": generic}))
    for kinds in _PAIRS if count == 2 else ((Vector,),):
        lower_builtin(function, *kinds)(lower)


def _instruction(name: str) -> Untyped:
    return lambda builder, *given: getattr(builder, name)(*given)


def _intrinsic(name: str) -> Untyped:
    def write(builder: Untyped, x: Untyped) -> Untyped:
        of = ir.FunctionType(x.type, [x.type])
        return builder.call(cgutils.get_or_insert_function(builder.module, of, f"llvm.{name}.v{WIDE}f64"), [x])

    return write


for _symbols, _name in {
    (operator.add, operator.iadd): "fadd",
    (operator.sub, operator.isub): "fsub",
    (operator.mul, operator.imul): "fmul",
    (operator.truediv, operator.itruediv): "fdiv",
}.items():
    for _symbol in _symbols:
        _define(_symbol, 2, _instruction(_name))
_define(operator.neg, 1, lambda builder, x: builder.fneg(x))
_define(abs, 1, _intrinsic("fabs"))
_define(math.sqrt, 1, _intrinsic("sqrt"))
_define(math.exp, 1, _intrinsic("exp"))
_define(max, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
_define(min, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))


@intrinsic
def select(_typing: Untyped, left: Untyped, right: Untyped, yes: Untyped, no: Untyped) -> Untyped:
    """Return ``yes`` where left > right, otherwise ``no``, for numbers or vectors. For NaN, the result is ``no``."""
    given = (left, right, yes, no)
    result = LANES if _is_vector_call(given, 4) else types.float64

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        a, b, c, d = (context.cast(builder, arg, t, result) for t, arg in zip(sig.args, args, strict=True))
        return builder.select(builder.fcmp_ordered(">", a, b), c, d)

    return result(*given), generate


@intrinsic
def anywhere(_typing: Untyped, flag: Untyped) -> Untyped:
    """Return whether ``flag`` is above zero in at least one run."""

    def generate(_context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        above = builder.fcmp_ordered(">", args[0], ir.Constant(args[0].type, None))
        if sig.args[0] != LANES:
            return above
        bits = ir.IntType(WIDE)
        return builder.icmp_unsigned("!=", builder.bitcast(above, bits), bits(0))

    return (types.boolean(flag), generate) if isinstance(flag, Vector | types.Float) else None


# Calls of a function for each run separately (`jerkbench.compilation.lanes.each_run`).


@intrinsic
def of_run(_typing: Untyped, values: Untyped, k: Untyped) -> Untyped:
    """Return the values of run ``k`` from a tuple: a number for each vector, and a column for each array of vectors."""
    kinds = types.Tuple([_of_one(kind) for kind in values])

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        offset = context.cast(builder, args[1], sig.args[1], types.intp)
        parts = zip(cgutils.unpack_tuple(builder, args[0]), sig.args[0], sig.return_type, strict=True)
        return context.make_tuple(builder, kinds, [_part(context, builder, offset, *part) for part in parts])

    return kinds(values, k), generate


def _of_one(kind: Untyped) -> Untyped:
    if isinstance(kind, types.Array) and isinstance(kind.dtype, Vector):
        return types.Array(types.float64, kind.ndim, "A")
    return types.float64 if isinstance(kind, Vector) else kind


def _part(
    context: Untyped, builder: Untyped, offset: Untyped, value: Untyped, kind: Untyped, of_one: Untyped
) -> Untyped:
    if kind is of_one:
        return value
    if isinstance(kind, Vector):
        return builder.extract_element(value, offset)
    array, column = context.make_array(kind)(context, builder, value), context.make_array(of_one)(context, builder)
    first = builder.gep(builder.bitcast(array.data, NUMBER.as_pointer()), [offset])
    populate_array(column, first, array.shape, array.strides, context.get_constant(types.intp, 8), None)
    return column._getvalue()  # noqa: SLF001 - as in numba


@intrinsic
def with_number(_typing: Untyped, vector: Untyped, k: Untyped, number: Untyped) -> Untyped:
    """Return a copy of ``vector`` in which the element of run ``k`` is ``number``."""

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        values = [
            context.cast(builder, arg, t, of)
            for arg, t, of in zip(args, sig.args, (LANES, types.intp, types.float64), strict=True)
        ]
        return builder.insert_element(values[0], values[2], values[1])

    return LANES(vector, k, number), generate


def each_run(function: Untyped, *given: Untyped) -> Untyped:
    """Return a vector with the result of ``function`` for each run. The last argument in ``given`` must be a vector."""
    answer = given[-1]
    for k in range(WIDE):
        answer = with_number(answer, k, function(*of_run(given, k)))
    return answer


IN_LANES = {
    lanes.select: select,
    lanes.anywhere: anywhere,
    lanes.above: lanes.above_in_lanes,
    lanes.each_run: each_run,
}
"""Replacements of the functions of `jerkbench.compilation.lanes` in a batch."""


# Arrays of vectors are fastest if they are aligned to cache lines.


def aligned_zeros(*shape: int) -> FloatArray:
    """Return an array of zeros that is aligned to the cache lines of the processor."""
    numbers = np.zeros(math.prod(shape) + WIDE)
    first = -(numbers.__array_interface__["data"][0] // numbers.itemsize) % WIDE
    return numbers[first : first + math.prod(shape)].reshape(shape)


# A compiler for functions that are called only by compiled code.
#
# By default, numba optimises every function and generates its machine code. numba repeats this work for each caller of
# the function, because the code of the function is linked into the caller. Only the machine code of the entry point,
# the function that Python calls, is executed. The following classes therefore optimise only the entry point, which
# reduces the compilation time to a small fraction.


class InnerLibrary(CPUCodeLibrary):
    """The unoptimised LLVM code of a function. The code is linked into the callers of the function."""

    def _optimize_functions(self, ll_module: Untyped) -> None:
        """Skip the optimisation, because the entry point is optimised after linking."""

    def _optimize_final_module(self) -> None:
        """Skip the optimisation, because the entry point is optimised after linking."""

    def _finalize_final_module(self) -> None:
        """Mark the module as finalised without generating machine code."""
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(NativeLowering):
    """A compiler pass that lowers a function into an `InnerLibrary`, and registers the function for its callers."""

    _name = "jerkbench_inner_lowering"

    def run_pass(self, state: Untyped) -> bool:
        """Generate the LLVM code of the function in ``state``."""
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        flags, state.flags = state.flags, state.flags.copy()
        state.flags.no_compile = True
        super().run_pass(state)
        state.flags = flags
        if hasattr(state.func_id.func, "not_inlined"):
            name = state.cr.fndesc.llvm_func_name
            state.library._final_module.get_function(name).add_function_attribute("noinline")  # noqa: SLF001
        key: Untyped = [].append  # numba requires a unique built-in function as the key
        state.cr = state.cr._replace(cfunc=key)
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        return True


class InnerCompiler(CompilerBase):
    """A numba compiler that runs the default passes, but `InnerLowering` instead of `NativeLowering`."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the only pipeline of the compiler."""
        manager = PassManager("jerkbench_inner")
        for compiler_pass, title in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            manager.add_pass(InnerLowering if compiler_pass is NativeLowering else compiler_pass, title)
        manager.finalize()
        return [manager]


def set_environments(entry: Untyped) -> None:
    """Register the constants of the inner functions of a compiled function.

    numba registers only the constants of functions for which it generates machine code.
    """
    for compiled in entry.overloads.values():
        for environment in compiled._find_referenced_environments():  # noqa: SLF001 - as numba does when it loads one
            compiled.codegen.set_env(environment.env_name, environment)
