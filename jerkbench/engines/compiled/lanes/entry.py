"""The compiled loop of several runs, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.entry import load_entry
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.reach import digest
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.lanes.loop import LaneKept, LaneModel, LaneSteps, run_lanes
from jerkbench.engines.compiled.lanes.places import places

SOURCE = '''"""Made by jerkbench: the loop of the compiled engine for several runs."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(adapt, fade, steps, model, parameters, fades, kept):
    loop(adapt, fade, steps, model, parameters, fades, kept)
'''


APART = (
    *("run_lanes", "start", "predict", "score", "measure", "notice", "correct", "check_definite", "finish"),
    *("square_to_pairs", "pairs_to_square", "_predict_any", "_adapt_some", "_pack_some", "_fade", "_unpack"),
)
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""


@cache
def lanes_for(n: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of WIDTH runs for filters with ``n`` quantities on each axis."""
    at = places(n)

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_lanes, home, at, kernel=True, apart=APART), "signature": _signature()}

    title = f"the loop for {WIDTH} runs of {3 * n} states"
    return load_entry(title, SOURCE, digest(run_lanes, places=at, width=WIDTH, apart=APART), namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    from numba import types

    f, i = types.float64, types.int64
    vector, matrix, cube, indices = f[::1], f[:, ::1], f[:, :, ::1], i[::1]
    given = (vector, vector, matrix, matrix, indices, vector)
    return types.void(
        types.FunctionType(types.void(*given, matrix)),
        types.FunctionType(f(*given)),
        types.NamedTuple([*[indices] * 5, *[cube] * 5, matrix, cube, *[matrix] * 4], LaneSteps),
        types.NamedTuple([cube, matrix, cube, vector], LaneModel),
        vector,
        types.boolean,
        types.NamedTuple([vector, matrix, cube, cube, vector, indices], LaneKept),
    )
