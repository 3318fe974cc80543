"""The compiled loop, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.estimation.adaptation_call import Rule, rule_type
from jerkbench.estimation.sums import Score, score_type
from jerkbench.inertial.compiled.arguments import Flow, Given, Kept
from jerkbench.inertial.compiled.layout import places
from jerkbench.inertial.compiled.loop import run_events

SOURCE = '''"""Made by jerkbench: the loop of the inertial navigation."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(flow, given, rule, kept, score, m):
    return loop(flow, given, rule, kept, score, m)
'''

APART = (
    *("run_events", "mechanise", "propagate", "move_column", "_fill_noise", "update", "take_heading", "constrain"),
    *("keep_state", "add_state", "_add_nees", "project", "pick", "distance", "correct", "feed_back", "_carry"),
    *("exchange", "symmetrise", "is_healthy", "clear", "expect_point", "expect_body_velocity", "fill_rotation"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""

ARGUMENTS = [(kind.__module__, kind.__name__, kind._fields) for kind in (Flow, Given, Rule, Kept, Score)]
"""They decide what the machine code reads where, and where its types are imported from."""


@cache
def loop_for(states: int, *, invariant: bool) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop for an error state of that size, invariant or additive."""
    at = places(states, invariant=invariant)

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_events, home, at, kernel=True, apart=APART), "signature": _signature()}

    title = f"the {'invariant ' if invariant else ''}inertial navigation with {states} states"
    return load_entry(title, SOURCE, digest(run_events, places=at, apart=APART, arguments=ARGUMENTS), namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f, i, b = types.float64, types.int64, types.boolean
    vector, matrix, cube, indices = f[::1], f[:, ::1], f[:, :, ::1], i[::1]
    return types.UniTuple(i, 3)(
        types.NamedTuple(
            [vector, *[indices] * 5, matrix, matrix, indices, matrix, cube, cube, matrix],
            Flow,
        ),
        types.NamedTuple([vector, b, vector, f, vector, vector, i, vector, f, f, f, vector, vector], Given),
        rule_type(),
        types.NamedTuple([indices, matrix, matrix, matrix, indices, matrix, indices], Kept),
        score_type(),
        vector,
    )
