"""The compiled loop of one run, from the disk where it was compiled before."""

import os
from functools import cache
from typing import Any

from jerkbench.compilation.background import run_beside
from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import is_kept, load_entry
from jerkbench.engines.compiled.arguments import Kept, Model, Rule, Steps
from jerkbench.engines.compiled.single.loop import run_steps
from jerkbench.engines.compiled.single.places import places, tables

APART = (
    *("run_steps", "correct", "definite", "_keep_reported"),
    *("_predict_any_state", "_predict_any_pair", "_adapt_some", "take_adapted", "_drop", "_fade"),
    *("mahalanobis_by_inverse", "correct_by_inverse"),
)
"""Kernels that stand alone, and those that are seldom called: inlined they would only cost time to compile."""

SOURCE = '''"""Made by jerkbench: the loop of the compiled engine."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, model, rule, kept, m, rows):
    return loop(steps, model, rule, kept, m, rows)
'''


ARGUMENTS = [(one.__name__, one._fields) for one in (Steps, Model, Rule, Kept)]
"""They decide what the machine code reads where."""


@cache
def loop_for(n: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop for filters with ``n`` quantities on each axis."""
    at, found = places(n), tables(n)

    def namespace(home: str) -> dict[str, Any]:
        loop = jitted(run_steps, home, {**at, **found}, kernel=True, apart=APART)
        return {"loop": loop, "signature": _signature()}

    return load_entry(*_named(n), namespace).entry


def compile_beside(n: int) -> None:
    """Let another process compile that loop, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_kept(*_named(n)):
        run_beside(f"from {__name__} import loop_for; loop_for({n})")


def _named(n: int) -> tuple[str, str, str]:
    """Title, source and key of the entry point."""
    lists = {name: table.tolist() for name, table in tables(n).items()}
    key = digest(run_steps, places=places(n), tables=lists, apart=APART, arguments=ARGUMENTS)
    return f"the loop for one run of {3 * n} states", SOURCE, key


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f, i = types.float64, types.int64
    vector, matrix, cube, indices = f[::1], f[:, ::1], f[:, :, ::1], i[::1]
    return types.UniTuple(i, 3)(
        types.NamedTuple([indices] * 4 + [matrix] * 2 + [cube] * 2, Steps),
        types.NamedTuple([cube, matrix, cube, vector, matrix, types.boolean], Model),
        types.NamedTuple([vector, vector, i, i], Rule),
        types.NamedTuple([indices, matrix, matrix, indices, vector, vector, vector, matrix, matrix], Kept),
        vector,
        indices,
    )
