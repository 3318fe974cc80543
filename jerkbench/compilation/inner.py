"""numba's compiler for a function that only compiled code calls.

numba optimises every function and makes machine code of it, and does both once more inside each function that calls it,
up to the one that is called from outside. Only what is made there is ever run: here it is the only one that is made,
which takes a third less time.
"""

from typing import Any

from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


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
