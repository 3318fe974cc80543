"""The compiled loop, from the disk where it was compiled before."""

import os
from functools import cache
from typing import Any

from jerkbench.compilation.background import run_beside
from jerkbench.compilation.compiled_loop import compiled_loop, is_compiled
from jerkbench.kinematic.layout import run_type
from jerkbench.kinematic.loop import run_steps

ALONE = ("run_steps", "start", "predict", "add_row", "mahalanobis", "correct", "check_definite")
SELDOM = (
    *("predict_any", "clear_absent", "_pack", "fade_prior", "_unpack"),
    *("advance", "adapt_prior", "take_whole", "put_covariance", "find_gains", "put_gains", "_own_update", "_widen"),
)
APART = ALONE + SELDOM
"""Kernels that stand alone, and those that are seldom called: one body of all of them takes long to compile."""


@cache
def loop_for(n: int, width: int, *, dense: bool = False) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for filters with ``n`` quantities on each axis.

    ``dense``: for adaptations that see whole matrices; all others have a loop without any of that.
    """
    return compiled_loop(run_steps, *_named(n, width, dense=dense))


def runs_of(width: int) -> str:
    """Return how a message says so many runs."""
    return "one run" if width == 1 else f"{width} runs"


def compile_beside(n: int) -> None:
    """Let another process compile the loop of one run, if it is not on the disk and there is a processor for it."""
    if (os.cpu_count() or 1) > 1 and not is_compiled(run_steps, *_named(n, 1, dense=False)):
        run_beside(f"from {__name__} import loop_for; loop_for({n}, 1)")


def _named(n: int, width: int, *, dense: bool) -> tuple[str, dict[str, Any], tuple[str, ...]]:
    title = f"the loop for {runs_of(width)} of {3 * n} states{', dense' * dense}"
    return title, {"RUN": run_type(n, width), "DENSE": int(dense)}, APART
