"""The compiled loop, from the disk where it was compiled before."""

import os
from functools import cache
from typing import Any

from jerkbench.compilation.background import run_beside
from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import is_kept, load_entry
from jerkbench.engines.compiled.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.engines.compiled.layout import layout, tables
from jerkbench.engines.compiled.loop import run_steps

ALONE = ("run_steps", "start", "predict", "add_row", "mahalanobis", "correct", "check_definite")
SELDOM = ("predict_any", "clear_absent", "_pack", "_fade", "_unpack")
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""

SOURCE = '''"""Made by jerkbench: the loop of the compiled engine."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, score, model, rules, kept, runs):
    return loop(steps, score, model, rules, kept, runs)
'''

ARGUMENTS = [(part.__name__, part._fields) for part in (Steps, Score, Model, Rules, Kept, Runs)]
"""They decide what the machine code reads where."""


@cache
def loop_for(n: int, width: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for filters with ``n`` quantities on each axis."""
    places = {**layout(n, width), **tables(n, width)}

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_steps, home, places, kernel=True, apart=APART), "signature": _signature()}

    return load_entry(*_named(n, width), namespace).entry


def compile_beside(n: int) -> None:
    """Let another process compile the loop of one run, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_kept(*_named(n, 1)):
        run_beside(f"from {__name__} import loop_for; loop_for({n}, 1)")


def _named(n: int, width: int) -> tuple[str, str, str]:
    """Title, source and key of the entry point."""
    lists = {name: table.tolist() for name, table in tables(n, width).items()}
    key = digest(run_steps, places=layout(n, width), tables=lists, apart=APART, arguments=ARGUMENTS)
    runs = "one run" if width == 1 else f"{width} runs"
    return f"the loop for {runs} of {3 * n} states", SOURCE, key


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f, i = types.float64, types.int64
    vector, matrix, cube, indices = f[::1], f[:, ::1], f[:, :, ::1], i[::1]
    return types.UniTuple(i, 2)(
        types.NamedTuple([*[indices] * 4, *[cube] * 4, *[matrix] * 2], Steps),
        types.NamedTuple([indices, matrix, cube, matrix, matrix], Score),
        types.NamedTuple([cube, cube, cube, matrix, types.boolean], Model),
        types.NamedTuple([matrix, indices, indices, matrix, indices], Rules),
        types.NamedTuple([vector, indices, cube, cube, cube, indices, cube], Kept),
        types.NamedTuple([*[matrix] * 6, vector, indices], Runs),
    )
