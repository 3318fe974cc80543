"""The compiled smoother, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.compiled_loop import (
    APART,
    kept_type,
    model_type,
    places_of,
    rules_type,
    runs_type,
    score_type,
    steps_type,
)
from jerkbench.linear.smoother.arguments import Tape
from jerkbench.linear.smoother.layout import places
from jerkbench.linear.smoother.loop import run_smoother

SOURCE = '''"""Made by jerkbench: the loops of the smoother."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, score, model, rules, kept, runs, tape):
    return loop(steps, score, model, rules, kept, runs, tape)
'''

OWN = (
    *("run_smoother", "run_forward", "run_back", "move", "step_back", "give", "smooth", "smooth_alone"),
    *("absorb", "retreat", "write_state", "read_state", "write_update"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""

PARTS = (Steps, Score, Model, Rules, Kept, Runs, Tape)
ARGUMENTS = [(part.__module__, part.__name__, part._fields) for part in PARTS]
"""They decide what the machine code reads where, and where its types are imported from."""


@cache
def smoother_for(n: int, width: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled smoother of ``width`` runs for a filter with ``n`` quantities on each axis."""
    kernel, lists = places_of(n, width)
    own, apart = places(n, width), APART + OWN

    def namespace(home: str) -> dict[str, Any]:
        loop = jitted(run_smoother, home, {**kernel, **own}, kernel=True, apart=apart)
        return {"loop": loop, "signature": _signature()}

    runs = "one run" if width == 1 else f"{width} runs"
    key = digest(run_smoother, places=lists, own=own, apart=apart, arguments=ARGUMENTS)
    return load_entry(f"the smoother of {runs} of {3 * n} states", SOURCE, key, namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loops: only such a one is found on the disk by the next process."""
    from numba import types

    vector, matrix, indices = types.float64[::1], types.float64[:, ::1], types.int64[::1]
    tape = types.NamedTuple([indices, indices, matrix, matrix, vector, vector], Tape)
    parts = steps_type(), score_type(), model_type(), rules_type(), kept_type(), runs_type(), tape
    return types.UniTuple(types.int64, 2)(*parts)
