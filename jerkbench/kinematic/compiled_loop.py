"""The compiled loop, from the disk where it was compiled before."""

import os
from functools import cache
from typing import Any

from jerkbench.compilation.background import run_beside
from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import is_kept, load_entry
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.layout import layout, tables
from jerkbench.kinematic.loop import run_steps

ALONE = ("run_steps", "start", "predict", "add_row", "mahalanobis", "correct", "check_definite")
SELDOM = (
    *("predict_any", "clear_absent", "_pack", "fade_prior", "_unpack"),
    *("advance", "adapt_prior", "take_whole", "put_covariance", "find_gains", "put_gains", "_own_update", "_widen"),
)
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""

SOURCE = '''"""Made by jerkbench: the loop of the compiled engine."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, score, model, rules, kept, runs):
    return loop(steps, score, model, rules, kept, runs)
'''

ARGUMENTS = [(part.__module__, part.__name__, part._fields) for part in (Steps, Score, Model, Rules, Kept, Runs)]
"""They decide what the machine code reads where, and where its types are imported from."""


@cache
def loop_for(n: int, width: int, *, dense: bool = False) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for filters with ``n`` quantities on each axis.

    ``dense``: for adaptations that see whole matrices; all others have a loop without any of that.
    """
    places, _ = places_of(n, width, dense=dense)

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_steps, home, places, kernel=True, apart=APART), "signature": _signature()}

    return load_entry(*_named(n, width, dense=dense), namespace).entry


def places_of(n: int, width: int, *, dense: bool = False) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the sizes and places of ``width`` runs of such a filter, and the same with lists for tables."""
    numbers = {**layout(n, width), "DENSE": int(dense)}
    lists = {name: table.tolist() for name, table in tables(n, width).items()}
    return {**numbers, **tables(n, width)}, {**numbers, **lists}


def compile_beside(n: int) -> None:
    """Let another process compile the loop of one run, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_kept(*_named(n, 1, dense=False)):
        run_beside(f"from {__name__} import loop_for; loop_for({n}, 1)")


def _named(n: int, width: int, *, dense: bool) -> tuple[str, str, str]:
    """Title, source and key of the entry point."""
    _, lists = places_of(n, width, dense=dense)
    key = digest(run_steps, places=lists, apart=APART, arguments=ARGUMENTS)
    runs = "one run" if width == 1 else f"{width} runs"
    return f"the loop for {runs} of {3 * n} states{', dense' * dense}", SOURCE, key


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    parts = steps_type(), score_type(), model_type(), rules_type(), kept_type(), runs_type()
    return types.UniTuple(types.int64, 2)(*parts)


def steps_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of `Steps`."""
    from numba import types

    f = types.float64
    return types.NamedTuple([*[types.int64[::1]] * 4, *[f[:, :, ::1]] * 4, *[f[:, ::1]] * 2], Steps)


def score_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of a `Score`."""
    from numba import types

    f = types.float64
    return types.NamedTuple([types.int64[::1], f[:, ::1], f[:, :, ::1], *[f[:, ::1]] * 2], Score)


def model_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of a `Model`."""
    from numba import types

    f = types.float64
    return types.NamedTuple([*[f[:, :, ::1]] * 3, f[:, ::1], types.boolean], Model)


def rules_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of `Rules`."""
    from numba import types

    matrix, indices = types.float64[:, ::1], types.int64[::1]
    return types.NamedTuple([matrix, *[indices] * 4, matrix, indices], Rules)


def kept_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of `Kept`."""
    from numba import types

    cube, indices = types.float64[:, :, ::1], types.int64[::1]
    return types.NamedTuple([types.float64[::1], indices, cube, cube, cube, indices, cube], Kept)


def runs_type() -> Any:  # noqa: ANN401 - as above
    """Return numba's type of `Runs`."""
    from numba import types

    vector, matrix = types.float64[::1], types.float64[:, ::1]
    return types.NamedTuple([*[matrix] * 6, vector, types.int64[::1], matrix, vector, matrix], Runs)
