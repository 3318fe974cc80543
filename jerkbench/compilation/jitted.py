"""A plain function and all that it calls, handed to numba as it is."""

import types
from collections.abc import Callable, Mapping
from typing import Any, cast

from jerkbench.compilation.code_digest import own_function, reached


def jitted(
    function: Callable[..., Any],
    home: str,
    constants: Mapping[str, object] | None = None,
    *,
    kernel: bool = False,
    apart: tuple[str, ...] = (),
) -> Any:  # noqa: ANN401 - numba has no types
    """Return ``function`` as a numba dispatcher; the functions that it calls need no decorator.

    Args:
        function: any function that numba's nopython mode understands.
        home: name of the module that numba will look for when it loads the result from the disk.
        constants: values that replace globals of that name, everywhere.
        kernel: whether everything becomes one body, in which a product and a sum may become one instruction (it rounds
            once instead of twice), and which makes no arrays: then no references to them are counted, which costs more
            than a small update does.
        apart: names of functions that stay outside that body, because they are rarely called.
    """
    return _Jit(home, dict(constants or {}), kernel, apart).of(cast("types.FunctionType", function))


class _Jit:
    """One compilation: every function becomes one dispatcher, whoever calls it."""

    def __init__(self, home: str, constants: dict[str, object], kernel: bool, apart: tuple[str, ...]) -> None:
        from numba import njit

        from jerkbench.compilation.inner import InnerCompiler

        options: dict[str, Any] = {"error_model": "numpy", "nogil": True}
        options["fastmath"] = {"contract"} if kernel else False
        options["_nrt"] = not kernel
        options["no_cpython_wrapper"] = options["no_cfunc_wrapper"] = True  # nobody calls them from outside
        options["pipeline_class"] = InnerCompiler
        # numba hands forceinline down to what an inlined function calls, where that does not say otherwise
        self.decorate = njit(**options, forceinline=False)
        self.decorate_inlined = njit(**options, forceinline=True)
        self.home, self.constants, self.kernel, self.apart = home, constants, kernel, apart
        self.done: dict[int, Any] = {}
        self.begun: list[int] = []

    def of(self, function: types.FunctionType) -> Any:  # noqa: ANN401 - numba has no types
        """Return the dispatcher of ``function``, made once; it is known before its globals are, for recursion.

        Raises:
            TypeError: functions call each other: numba compiles that, but what it keeps on the disk cannot be loaded.
        """
        if id(function) not in self.done:
            scope: dict[str, Any] = {}
            copy = _copy(function, scope, tuple(self._cell(cell) for cell in function.__closure__ or ()), self.home)
            inlined = function.__name__ not in self.apart
            self.done[id(function)] = (self.decorate_inlined if inlined else self.decorate)(copy)
            self.begun.append(id(function))
            scope.update(self._scope(function))
            self.begun.pop()
        elif id(function) in self.begun[:-1]:
            raise TypeError(f"{function.__name__} and a function that it calls call each other")
        return self.done[id(function)]

    def _scope(self, function: types.FunctionType) -> dict[str, Any]:
        """The globals of ``function`` with dispatchers in place of functions."""
        values = {name: self._value(value) for name, value in reached(function).items()}
        replaced = {name: self.constants[name] for name in values if name in self.constants}
        return {**values, **replaced, "__name__": self.home, "__builtins__": __builtins__}

    def _cell(self, cell: types.CellType) -> types.CellType:
        return types.CellType(self._value(cell.cell_contents))

    def _value(self, value: Any) -> Any:  # noqa: ANN401 - any global of a module
        function = own_function(value)
        return value if function is None else self.of(function)


def _copy(function: types.FunctionType, scope: dict[str, Any], closure: tuple[types.CellType, ...], home: str) -> Any:  # noqa: ANN401 - goes to numba
    """Return ``function`` in another module: under its own name a linker would take one compilation for another."""
    copy = types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__, closure or None)
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__module__ = scope["__name__"] = home
    return copy
