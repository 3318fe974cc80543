"""The adaptation of a run, compiled as its author wrote it."""

from collections.abc import Hashable
from functools import lru_cache
from typing import cast

from jerkbench.compilation.methods import Method, address_of, compiled_method, parameter_vector
from jerkbench.contracts import Adaptation
from jerkbench.engines.compiled.arguments import Rule
from jerkbench.memory import empty_memory

GIVEN = (
    ("innovation", "float64", "m"),
    ("HPHt", "float64", "(m, m)"),
    ("R", "float64", "(m, m)"),
    ("rows", "int64", "m"),
    ("memory", "float64", "size"),
)
ADAPT = Method("adapt", GIVEN, ("m", "size"), (("m", 6),), "(m, m)")
FADE = Method("fade", GIVEN, ("m", "size"), (("m", 6),), "")


def rule_of(adaptation: Adaptation) -> Rule:
    """Return the compiled adaptation with a memory of zeros.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        numba.core.errors.UnsupportedBytecodeError: likewise; it is no NumbaError.
        TypeError: `adapt` is no plain function.
    """
    adapt, fade = _addresses(cast("Hashable", adaptation))
    return Rule(parameter_vector(adaptation), empty_memory(adaptation), adapt, fade)


@lru_cache(maxsize=256)
def _addresses(adaptation: Hashable) -> tuple[int, int]:
    adapt = address_of(compiled_method(adaptation, ADAPT))
    return adapt, address_of(compiled_method(adaptation, FADE)) if hasattr(adaptation, "fade") else 0
