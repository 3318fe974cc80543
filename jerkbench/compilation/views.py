"""Runs and matrices in compiled code: ``run.P[s, t]``, ``run.y[r]``, one source for one run and for several.

`Lanes` are the array of one or several runs, a `View` is a part of such an array. Both are one address; what lies where
stands in their types, so that the compiler folds it. An element is a vector of ``width`` numbers, one of each run
(`jerkbench.compilation.vectors`); of one run it is a number.
"""

import hashlib
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global, signature
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)

from jerkbench.arrays import WIDE
from jerkbench.compilation.vectors import INDEX, LONG, NUMBER, llvm_vector, repeated, turned, vector_of

Untyped = Any
"""What numba and llvmlite, which have no types, hand over."""


class View(types.Type):
    """Elements at ``places``: how many numbers each lies behind the first, by index in C order."""

    def __init__(self, shape: tuple[int, ...], places: Sequence[int], width: int) -> None:
        """Name the type after all that it is."""
        self.shape, self.places, self.width, self.element = shape, tuple(places), width, vector_of(width)
        super().__init__(name=f"View{shape}x{width}@{_short(self.places)}")


class Lanes(types.Type):
    """The array of ``width`` runs; its attributes are its fields, its sizes, ``width``, and ``zero``.

    A field without axes is read and set itself. The part of one of the runs (`lane`) are Lanes of width 1, too.
    """

    def __init__(self, fields: Mapping[str, View], sizes: Mapping[str, int], width: int) -> None:
        """Name the type after all that it is."""
        self.fields, self.sizes, self.width = fields, {**sizes, "width": width}, width
        places = [(name, view.shape, view.places, view.width) for name, view in fields.items()]
        super().__init__(name=f"Lanes{sorted(self.sizes.items())}@{_short(places)}")


def _short(places: object) -> str:
    return hashlib.sha256(repr(places).encode()).hexdigest()[:12]


@register_model(View)
@register_model(Lanes)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, manager: Untyped, of: Untyped) -> None:
        super().__init__(manager, of, NUMBER.as_pointer())


def fields_of(shapes: Mapping[str, tuple[int, ...]], width: int) -> tuple[dict[str, View], int]:
    """Return a field for each shape, one after the other, and how many numbers they have together."""
    views, begin = {}, 0
    for name, shape in shapes.items():
        length = math.prod(shape)
        views[name] = View(shape, range(width * begin, width * (begin + length), width), width)
        begin += length
    return views, width * begin


# Elements


def _number(builder: Untyped, view: View, index: Untyped) -> Untyped:
    """How many numbers an element lies behind the first; a constant where the index is one."""
    flat = LONG(0)
    for i, length in zip(index, view.shape, strict=True):
        flat = builder.add(builder.mul(flat, LONG(length)), i)
    steps = {b - a for a, b in zip(view.places, view.places[1:], strict=False)}
    if len(steps) < 2:
        return builder.add(builder.mul(flat, LONG(steps.pop() if steps else 0)), LONG(view.places[0]))
    name = f"places.{_short(view.places)}"
    table = builder.module.globals.get(name)
    if table is None:
        whole = ir.Constant(ir.ArrayType(LONG, len(view.places)), list(view.places))
        table = cgutils.global_constant(builder, name, whole)
    return builder.load(builder.gep(table, [LONG(0), flat]))


def _at(builder: Untyped, first: Untyped, number: Untyped, width: int) -> Untyped:
    return builder.bitcast(builder.gep(first, [number]), llvm_vector(width).as_pointer())


def _load(builder: Untyped, first: Untyped, number: Untyped, width: int) -> Untyped:
    loaded = builder.load(_at(builder, first, number, width))
    loaded.align = 8
    return loaded


def _store(builder: Untyped, value: Untyped, first: Untyped, number: Untyped, width: int) -> None:
    builder.store(value, _at(builder, first, number, width)).align = 8


def _indices(context: Untyped, builder: Untyped, kind: Untyped, value: Untyped) -> list[Untyped]:
    parts = list(zip(cgutils.unpack_tuple(builder, value), kind, strict=True)) if _several(kind) else [(value, kind)]
    return [context.cast(builder, part, of, types.intp) for part, of in parts]


def _several(kind: Untyped) -> bool:
    return isinstance(kind, types.BaseTuple)


def _fits(view: Untyped, index: Untyped) -> bool:
    parts = tuple(index) if _several(index) else (index,)
    return isinstance(view, View) and len(parts) == len(view.shape) and all(isinstance(p, types.Integer) for p in parts)


@infer_global(operator.getitem)
class _Get(AbstractTemplate):
    def generic(self, args: Untyped, _kws: Untyped) -> Untyped:
        """Return the types of ``view[i, j]``, or None where this is none."""
        return signature(args[0].element, *args) if _fits(*args) else None


@infer_global(operator.setitem)
class _Set(AbstractTemplate):
    def generic(self, args: Untyped, _kws: Untyped) -> Untyped:
        """Return the types of ``view[i, j] = element``, or None where this is none."""
        return signature(types.none, *args[:2], args[0].element) if _fits(*args[:2]) else None


@lower_builtin(operator.getitem, View, types.Any)
def _get_element(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
    view, index = sig.args[0], _indices(context, builder, sig.args[1], args[1])
    return _load(builder, args[0], _number(builder, view, index), view.width)


@lower_builtin(operator.setitem, View, types.Any, types.Any)
def _set_element(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
    view, index = sig.args[0], _indices(context, builder, sig.args[1], args[1])
    _store(builder, args[2], args[0], _number(builder, view, index), view.width)
    return context.get_dummy_value()


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Lanes

    def generic_resolve(self, run: Lanes, name: str) -> Untyped:
        """Return the type of a run's attribute, or None where there is none."""
        if name in run.sizes:
            return types.intp
        if name == "zero":
            return vector_of(run.width)
        view = run.fields.get(name)
        return view if view is None or view.shape else view.element


@lower_getattr_generic(Lanes)
def _get_field(_context: Untyped, builder: Untyped, run: Lanes, value: Untyped, name: str) -> Untyped:
    if name in run.sizes:
        return LONG(run.sizes[name])
    if name == "zero":
        return ir.Constant(llvm_vector(run.width), [0.0] * run.width if run.width > 1 else 0.0)
    view = run.fields[name]
    return value if view.shape else _load(builder, value, LONG(view.places[0]), view.width)


@lower_setattr_generic(Lanes)
def _set_field(_context: Untyped, builder: Untyped, sig: Untyped, args: Untyped, name: str) -> None:
    view = sig.args[0].fields[name]
    _store(builder, args[1], args[0], LONG(view.places[0]), view.width)


# Runs and rows of arrays


def data_of(context: Untyped, builder: Untyped, kind: Untyped, array: Untyped) -> Untyped:
    """Return the address of an array's first element."""
    return context.make_array(kind)(context, builder, array).data


@intrinsic
def runs_in(_typing: Untyped, array: Untyped, kind: Untyped) -> Untyped:
    """See a contiguous array as the `Lanes` type ``kind``. Keep the array alive."""

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        return data_of(context, builder, sig.args[0], args[0])

    return kind.instance_type(array, kind), generate


@intrinsic
def lane(_typing: Untyped, run: Untyped, k: Untyped) -> Untyped:
    """Return run number ``k`` of several, as it is alone: what is written to it is written to them."""
    alone = Lanes({name: View(v.shape, v.places, 1) for name, v in run.fields.items()}, run.sizes, 1)

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        return builder.gep(args[0], [context.cast(builder, args[1], sig.args[1], types.intp)])

    return alone(run, k), generate


def _regular(run: Lanes, dims: Untyped, width: int) -> View | None:
    """A matrix of its own, of ``dims`` (a constant): sizes of the run, or numbers; ask again with the constant."""
    if not isinstance(dims, types.StringLiteral):
        return None
    sizes = [int(dim) if dim.isdigit() else run.sizes[dim] for dim in dims.literal_value.split()]
    return View(tuple(sizes), range(0, width * math.prod(sizes), width), width)


def _stack(builder: Untyped, view: View) -> Untyped:
    """Room on the stack; numba's own way fills it with zeros each time, which takes as long as a step."""
    with builder.goto_entry_block():
        whole = builder.alloca(ir.ArrayType(llvm_vector(view.width), len(view.places)))
    return builder.bitcast(whole, NUMBER.as_pointer())


def _room(*, wide: bool) -> Untyped:
    def room_of(_typing: Untyped, run: Untyped, dims: Untyped) -> Untyped:
        view = _regular(run, dims, WIDE if wide else run.width)

        def generate(_context: Untyped, builder: Untyped, sig: Untyped, _args: Untyped) -> Untyped:
            view = sig.return_type
            return _stack(builder, view)

        return view and (view(run, dims), generate)

    return intrinsic(prefer_literal=True)(room_of)


room: Callable[..., Any] = _room(wide=False)
"""``room(run, "n n")``: a matrix until the function returns, of any content; what never leaves it needs no memory."""

wide_room: Callable[..., Any] = _room(wide=True)
"""The same of vectors of `WIDE` numbers, also of one run."""


@intrinsic(prefer_literal=True)
def row(_typing: Untyped, array: Untyped, k: Untyped, run: Untyped, dims: Untyped) -> Untyped:
    """``row(array, k, run, "6 6")``: the k-th matrix in an array of them, one of each run."""
    view = _regular(run, dims, run.width)

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        view, k = sig.return_type, context.cast(builder, args[1], sig.args[1], types.intp)
        data = data_of(context, builder, sig.args[0], args[0])
        return builder.gep(data, [builder.mul(k, LONG(view.width * len(view.places)))])

    return view and (view(array, k, run, dims), generate)


@intrinsic(prefer_literal=True)
def taken(_typing: Untyped, array: Untyped, k: Untyped, run: Untyped, dims: Untyped) -> Untyped:
    """``taken(array, k, run, "6")``: a matrix to read until the function returns; of several runs a copy.

    What they share is repeated.
    """
    view = _regular(run, dims, run.width)

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        view, k = sig.return_type, context.cast(builder, args[1], sig.args[1], types.intp)
        given = context.make_array(sig.args[0])(context, builder, args[0])
        last = builder.extract_value(given.shape, sig.args[0].ndim - 1)
        first = builder.gep(given.data, [builder.mul(k, builder.mul(last, LONG(len(view.places))))])
        if view.width == 1:
            return first
        into = _stack(builder, view)
        with builder.if_else(builder.icmp_signed("==", last, LONG(1))) as (shared, apart):
            with shared:
                for e, place in enumerate(view.places):
                    number = _load(builder, first, LONG(e), 1)
                    _store(builder, repeated(builder, number, view.width), into, LONG(place), view.width)
            with apart:
                for place in view.places:
                    _store(builder, _load(builder, first, LONG(place), view.width), into, LONG(place), view.width)
        return into

    return view and (view(array, k, run, dims), generate)


@intrinsic
def eights(_typing: Untyped, view: Untyped) -> Untyped:
    """See a `room` of one run as vectors of eight numbers."""
    vectors = View((len(view.places) // WIDE,), range(0, len(view.places), WIDE), WIDE)

    def generate(_context: Untyped, _builder: Untyped, _sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        return args[0]

    return vectors(view), generate


# Many elements at once


@intrinsic
def copy(_typing: Untyped, into: Untyped, given: Untyped) -> Untyped:
    """Copy a matrix into one that lies in order; the numbers of one run are picked eight at a time."""

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        places, loaded = sig.args[1].places, {}

        def eight(k: int) -> Untyped:
            if k not in loaded:
                loaded[k] = _load(builder, args[1], LONG(WIDE * k), WIDE)
            return loaded[k]

        if sig.args[1].width == WIDE:
            for e, place in enumerate(places):
                _store(builder, eight(place // WIDE), args[0], LONG(WIDE * e), WIDE)
        else:
            for first in sorted({*range(0, len(places) - WIDE + 1, WIDE), len(places) - WIDE}):
                wanted = places[first : first + WIDE]
                used = sorted({place // WIDE for place in wanted})
                numbers = [WIDE * used.index(place // WIDE) + place % WIDE for place in wanted]
                _store(builder, _picked(builder, [eight(k) for k in used], numbers), args[0], LONG(first), WIDE)
        return context.get_dummy_value()

    return types.void(into, given), generate


def _picked(builder: Untyped, parts: list[Untyped], numbers: list[int]) -> Untyped:
    """A vector of some of the numbers of vectors."""
    while len(parts) > 1 or parts[0].type.count == WIDE:
        parts = parts + parts[-1:] * (len(parts) % 2)
        whole = 2 * parts[0].type.count
        joined = ir.Constant(ir.VectorType(INDEX, whole), list(range(whole)))
        parts = [builder.shuffle_vector(a, b, joined) for a, b in zip(parts[::2], parts[1::2], strict=True)]
    return builder.shuffle_vector(parts[0], parts[0], ir.Constant(ir.VectorType(INDEX, WIDE), numbers))


@intrinsic
def ask_for(_typing: Untyped, view: Untyped) -> Untyped:
    """Ask the memory, which is slow to answer, for a matrix that a later step reads; it may lie beyond the end.

    It goes to the second cache: the first one is full of the runs themselves.
    """

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        kind, byte = ir.IntType(32), ir.IntType(8).as_pointer()
        takes = ir.FunctionType(ir.VoidType(), [byte, *[kind] * 3])
        ask = builder.module.declare_intrinsic("llvm.prefetch", (byte,), takes)
        for place in sig.args[0].places:
            at = builder.gep(args[0], [LONG(place)])
            builder.call(ask, [builder.bitcast(at, byte), kind(0), kind(2), kind(1)])
        return context.get_dummy_value()

    return types.void(view), generate


def _blocks(places: Sequence[int]) -> list[list[int]]:
    """The places by eights; the last ones are repeated up to a whole eight."""
    whole = [*places, *[places[-1]] * (-len(places) % WIDE)]
    return [whole[first : first + WIDE] for first in range(0, len(whole), WIDE)]


@intrinsic
def spread(_typing: Untyped, into: Untyped, view: Untyped) -> Untyped:
    """Write the matrix of each run into its row of ``into``, whose length is a whole number of eights."""

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        data, view = data_of(context, builder, sig.args[0], args[0]), sig.args[1]
        blocks = _blocks(view.places)
        for b, block in enumerate(blocks):
            elements = [_load(builder, args[1], LONG(place), view.width) for place in block]
            for k, element in enumerate(elements if view.width == 1 else turned(builder, elements)):
                at = WIDE * b + k if view.width == 1 else WIDE * (len(blocks) * k + b)
                _store(builder, element, data, LONG(at), view.width)
        return context.get_dummy_value()

    return types.void(into, view), generate


@intrinsic
def gather(_typing: Untyped, view: Untyped, given: Untyped) -> Untyped:
    """Read the matrix of each run from its row of ``given``: the reverse of `spread`."""

    def generate(context: Untyped, builder: Untyped, sig: Untyped, args: Untyped) -> Untyped:
        """Write it in LLVM."""
        data, view = data_of(context, builder, sig.args[1], args[1]), sig.args[0]
        blocks = _blocks(view.places)
        for b, block in enumerate(blocks):
            at = [WIDE * b + k if view.width == 1 else WIDE * (len(blocks) * k + b) for k in range(WIDE)]
            rows = [_load(builder, data, LONG(number), view.width) for number in at]
            elements = rows if view.width == 1 else turned(builder, rows)
            for place, element in zip(block[: len(view.places) - WIDE * b], elements, strict=False):
                _store(builder, element, args[0], LONG(place), view.width)
        return context.get_dummy_value()

    return types.void(view, given), generate
