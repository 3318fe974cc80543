"""The compiled loop, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.compilation.vectors import WIDE
from jerkbench.inertial.side_by_side.arguments import Inertial
from jerkbench.inertial.side_by_side.loop import run_together
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.compiled_loop import APART, kept_type, places_of, rules_type, runs_type, score_type, steps_type

QUANTITIES = 5
"""Position, velocity, attitude, and the biases of gyro and accelerometer."""

SOURCE = '''"""Made by jerkbench: the loop of the inertial navigation, side by side."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, score, inertial, rules, kept, runs):
    return loop(steps, score, inertial, rules, kept, runs)
'''

OWN = (
    "run_together",
    "begin",
    "mechanise",
    "propagate",
    "feed_back",
    "_carry",
    "fill_turn",
    "_fill_large",
    "take_heading",
)
"""Kernels that stand alone: one body of all of them takes long to compile."""

PARTS = (Steps, Score, Inertial, Rules, Kept, Runs)
ARGUMENTS = [(part.__module__, part.__name__, part._fields) for part in PARTS]
"""They decide what the machine code reads where, and where its types are imported from."""


@cache
def loop_together() -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of WIDE runs."""
    places, lists = places_of(QUANTITIES, WIDE)
    apart = APART + OWN

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_together, home, places, kernel=True, apart=apart), "signature": _signature()}

    key = digest(run_together, places=lists, apart=apart, arguments=ARGUMENTS)
    return load_entry(f"the inertial navigation of {WIDE} runs", SOURCE, key, namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f = types.float64
    vector, matrix, cube = f[::1], f[:, ::1], f[:, :, ::1]
    inertial = types.NamedTuple(
        [vector, cube, cube, matrix, vector, matrix, matrix, types.int64[::1], cube, cube], Inertial
    )
    parts = steps_type(), score_type(), inertial, rules_type(), kept_type(), runs_type()
    return types.UniTuple(types.int64, 2)(*parts)
