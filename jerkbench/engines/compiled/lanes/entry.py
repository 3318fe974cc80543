"""The compiled loop of several runs, from the disk where it was compiled before."""

from functools import cache
from typing import Any

from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.arguments import Rule
from jerkbench.engines.compiled.lanes.arguments import LaneKept, LaneModel, LaneSteps
from jerkbench.engines.compiled.lanes.loop import run_lanes
from jerkbench.engines.compiled.lanes.places import places, tables
from jerkbench.engines.compiled.lanes.runs import Runs

SOURCE = '''"""Made by jerkbench: the loop of the compiled engine for several runs."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(steps, model, rule, kept):
    loop(steps, model, rule, kept)
'''


ALONE = (
    "run_lanes",
    "start",
    "predict",
    "score",
    "measure",
    "notice",
    "adapt_runs",
    "correct",
    "check_definite",
    "finish",
)
SELDOM = ("_pack_some", "_fade", "_unpack")
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""


ARGUMENTS = [(one.__name__, one._fields) for one in (LaneSteps, LaneModel, Rule, LaneKept, Runs)]
"""They decide what the machine code reads where."""


@cache
def lanes_for(n: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of WIDTH runs for filters with ``n`` quantities on each axis."""
    at, found = places(n), tables(n)

    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_lanes, home, {**at, **found}, kernel=True, apart=APART), "signature": _signature()}

    title = f"the loop for {WIDTH} runs of {3 * n} states"
    lists = {name: table.tolist() for name, table in found.items()}
    key = digest(run_lanes, places=at, tables=lists, apart=APART, arguments=ARGUMENTS)
    return load_entry(title, SOURCE, key, namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    from numba import types

    f, i = types.float64, types.int64
    vector, matrix, cube, indices = f[::1], f[:, ::1], f[:, :, ::1], i[::1]
    return types.void(
        types.NamedTuple([*[indices] * 6, *[cube] * 5, matrix, cube, *[matrix] * 4], LaneSteps),
        types.NamedTuple([cube, matrix, cube, vector], LaneModel),
        types.NamedTuple([vector, vector, i, i], Rule),
        types.NamedTuple([vector, matrix, cube, cube, types.NamedUniTuple(matrix, 6, Runs), vector, indices], LaneKept),
    )
