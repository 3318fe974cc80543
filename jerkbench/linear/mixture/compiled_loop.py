"""The compiled mixture, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.compiled_loop import APART, kept_type, places_of, rules_type, runs_type, score_type, steps_type
from jerkbench.linear.mixture.arguments import Mixing
from jerkbench.linear.mixture.layout import sizes
from jerkbench.linear.mixture.loop import run_mixture

SOURCE = '''"""Made by jerkbench: the loop of mixed filters."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, score, mixing, rules, kept, runs):
    return loop(steps, score, mixing, rules, kept, runs)
'''

OWN = ("run_mixture", "begin", "move", "combine", "log_likelihood", "weigh", "mix", "correct_filter")
"""Kernels that stand alone: one body of all of them takes long to compile."""

ARGUMENTS = [(part.__module__, part.__name__, part._fields) for part in (Steps, Score, Mixing, Rules, Kept, Runs)]
"""They decide what the machine code reads where, and where its types are imported from."""


@cache
def mixture_for(n: int, width: int, count: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for ``count`` filters with ``n`` quantities on each axis."""
    places, lists = places_of(n, width)
    apart = APART + OWN

    def namespace(home: str) -> dict[str, Any]:
        constants = {**places, **sizes(count, 3 * n)}
        return {"loop": jitted(run_mixture, home, constants, kernel=True, apart=apart), "signature": _signature()}

    runs = "one run" if width == 1 else f"{width} runs"
    key = digest(run_mixture, places=lists, sizes=sizes(count, 3 * n), apart=apart, arguments=ARGUMENTS)
    return load_entry(f"{count} mixed filters, {runs} of {3 * n} states", SOURCE, key, namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f = types.float64
    matrix, cube, four = f[:, ::1], f[:, :, ::1], f[:, :, :, ::1]
    mixing = types.NamedTuple([four, four, four, types.boolean, cube, cube, *[matrix] * 4], Mixing)
    return types.UniTuple(types.int64, 2)(steps_type(), score_type(), mixing, rules_type(), kept_type(), runs_type())
