"""A numba compiler for functions that are called only by compiled code.

By default, numba optimises every function and generates its machine code. numba repeats this work for each caller of
the function, because the code of the function is linked into the caller. Only the machine code of the entry point, the
function that Python calls, is executed, so the classes of this module optimise only the entry point, which reduces
the compilation time to a small fraction.
"""

from typing import Any

from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class InnerLibrary(CPUCodeLibrary):
    """The unoptimised LLVM code of a function. The code is linked into the callers of the function."""

    def _optimize_functions(self, ll_module: Any) -> None:  # noqa: ANN401 - llvmlite has no types
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

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401 - numba has no types
        """Generate the LLVM code of the function in ``state``."""
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        flags, state.flags = state.flags, state.flags.copy()
        state.flags.no_compile = True
        super().run_pass(state)
        state.flags = flags
        if hasattr(state.func_id.func, "not_inlined"):
            name = state.cr.fndesc.llvm_func_name
            state.library._final_module.get_function(name).add_function_attribute("noinline")  # noqa: SLF001
        key: Any = [].append  # numba requires a unique built-in function as the key
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


def set_environments(entry: Any) -> None:  # noqa: ANN401 - numba has no types
    """Register the constants of the inner functions of a compiled function.

    numba registers only the constants of functions for which it generates machine code.
    """
    for compiled in entry.overloads.values():
        for environment in compiled._find_referenced_environments():  # noqa: SLF001 - as numba does when it loads one
            compiled.codegen.set_env(environment.env_name, environment)
