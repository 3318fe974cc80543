"""A plain function and all that it calls, handed to numba as it is.

numba optimises every function and makes machine code of it, and does both once more inside each function that calls it,
up to the one that is called from outside. Only what is made there is ever run: here it is the only one that is made,
which takes a third less time.
"""

import types
from collections.abc import Callable, Mapping
from typing import Any, cast

from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering

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
            cells = tuple(types.CellType(self._value(cell.cell_contents)) for cell in function.__closure__ or ())
            copy = types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__, cells or None)
            copy.__kwdefaults__ = function.__kwdefaults__
            # under its own name a linker would take one compilation for another
            copy.__module__ = scope["__name__"] = self.home
            copy.stands_apart = not (inlined := function.__name__ not in self.apart)  # type: ignore[attr-defined]
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
        replaced = {name: self._value(self.constants[name]) for name in values if name in self.constants}
        return {**values, **replaced, "__name__": self.home, "__builtins__": __builtins__}

    def _value(self, value: Any) -> Any:  # noqa: ANN401 - any global of a module
        function = own_function(value)
        return value if function is None else self.of(function)


# numba's compiler for a function that only compiled code calls.


class InnerLibrary(CPUCodeLibrary):  # type: ignore[misc]  # numba has no types
    """LLVM's form of a function, to be linked into its callers as it is."""

    def _optimize_final_module(self) -> None:
        """Leave it to the function that is called from outside."""

    def _finalize_final_module(self) -> None:
        """Hand nothing to the engine, which would make machine code of it."""
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(NativeLowering):  # type: ignore[misc]  # numba has no types
    """Lowers a function into an `InnerLibrary`, and tells numba where its callers find it."""

    _name = "jerkbench_inner_lowering"

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401 - numba has no types
        """Lower the function that ``state`` describes."""
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        flags, state.flags = state.flags, state.flags.copy()
        state.flags.no_compile = True
        super().run_pass(state)
        state.flags = flags
        if state.func_id.func.stands_apart:  # else LLVM puts what is short on this processor into each of its callers
            state.library._final_module.get_function(state.cr.fndesc.llvm_func_name).add_function_attribute("noinline")  # noqa: SLF001 - our own library's
        key: Any = [].append  # numba asks for a built-in to know the function by; that of a new list is like no other
        state.cr = state.cr._replace(cfunc=key)
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        return True


class InnerCompiler(CompilerBase):  # type: ignore[misc]  # numba has no types
    """numba's own passes, but for the last."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the one pipeline."""
        manager = PassManager("jerkbench_inner")
        for compiler_pass, title in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            manager.add_pass(InnerLowering if compiler_pass is NativeLowering else compiler_pass, title)
        manager.finalize()
        return [manager]
