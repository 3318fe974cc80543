"""The adaptation of a run, compiled as its author wrote it."""

from collections.abc import Hashable
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np

from jerkbench.compilation.methods import Method, compiled_method, parameter_vector
from jerkbench.contracts import Adaptation
from jerkbench.engines.compiled.arguments import Rule
from jerkbench.engines.compiled.never import NoFade

ARGUMENTS = ("innovation", "HPHt", "R", "rows", "memory")
GIVEN = "float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], int64[::1], float64[::1]"
ADAPT = Method("adapt", ARGUMENTS, f"void({GIVEN}, float64[:, ::1])", fills=True)
FADE = Method("fade", ARGUMENTS, f"float64({GIVEN})", fills=False)


class CompiledRule(NamedTuple):
    """Functions that the loop calls, and what they are called with.

    Attributes:
        adapt: fills the adapted R.
        fade: returns the factor on the prior covariance; never called where the plugin has none.
        rule: the parameters and an empty memory.
    """

    adapt: Any
    fade: Any
    rule: Rule


def rule_of(adaptation: Adaptation) -> CompiledRule:
    """Return the compiled adaptation with a memory of zeros.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        TypeError: `adapt` is no plain function.
    """
    adapt, fade = _functions(cast("Hashable", adaptation))
    memory = np.zeros(adaptation.memory_size())
    return CompiledRule(adapt, fade, Rule(parameter_vector(adaptation), memory, hasattr(adaptation, "fade")))


@lru_cache(maxsize=256)
def _functions(adaptation: Hashable) -> tuple[Any, Any]:
    adapt = compiled_method(adaptation, ADAPT)
    return adapt, compiled_method(adaptation if hasattr(adaptation, "fade") else NoFade(), FADE)
