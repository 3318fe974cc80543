"""The compiled mixture, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.estimation.adaptation_call import Rule, rule_type
from jerkbench.estimation.sums import Score, score_type
from jerkbench.linear.arguments import Kept, Models, Steps
from jerkbench.linear.layout import places
from jerkbench.linear.mixture import run_mixture

SOURCE = '''"""Made by jerkbench: the loop of mixed filters."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, models, rule, kept, score, filters):
    return loop(steps, models, rule, kept, score, filters)
'''

APART = (
    *("run_mixture", "predict", "update", "keep_state", "combine", "mix", "_correct", "_show", "_use"),
    *("add_state", "_add_nees", "project", "distance", "correct", "symmetrise", "is_definite", "clear"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""

ARGUMENTS = [(kind.__name__, kind._fields) for kind in (Steps, Models, Rule, Kept, Score)]
"""They decide what the machine code reads where."""


@cache
def mixture_for(states: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop for filters with so many states."""
    at = places(states)

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_mixture, home, at, kernel=True, apart=APART), "signature": _signature()}

    title = f"mixed filters with {states} states"
    return load_entry(title, SOURCE, digest(run_mixture, places=at, apart=APART, arguments=ARGUMENTS), namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f, i = types.float64, types.int64
    vector, matrix, cube, four, indices = f[::1], f[:, ::1], f[:, :, ::1], f[:, :, :, ::1], i[::1]
    return types.UniTuple(i, 3)(
        types.NamedTuple([indices] * 4 + [matrix, matrix, cube, cube], Steps),
        types.NamedTuple([four, cube, four, matrix, vector, vector, vector], Models),
        rule_type(),
        types.NamedTuple([indices, matrix, matrix, indices, matrix, indices, indices], Kept),
        score_type(),
        matrix,
    )
