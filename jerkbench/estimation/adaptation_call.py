"""The adaptation of a compiled estimator, compiled and called as its author wrote it."""

from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from jerkbench.arrays import FloatVector, IntVector
from jerkbench.compilation.calls import fill_by
from jerkbench.compilation.methods import Method, address_of, compiled_method, parameter_vector
from jerkbench.compilation.module_cache import can_compile
from jerkbench.memory import empty_memory
from jerkbench.notices import notify

Made = TypeVar("Made")

GIVEN = (
    ("innovation", "float64", "m"),
    ("HPHt", "float64", "(m, m)"),
    ("R", "float64", "(m, m)"),
    ("rows", "int64", "m"),
    ("memory", "float64", "size"),
)
ADAPT = Method("adapt", GIVEN, ("m", "size"), (("m", 6),), "(m, m)")


class Rule(NamedTuple):
    """A compiled adaptation in one run.

    Attributes:
        parameters: its numbers.
        memory: what it remembers, zero at the start.
        adapt: address of its `adapt`.
        rows: (6,) room: which rows of z are there.
        y: (6,) room for the innovation.
        HPHt: (36,) room.
        R: (36,) room for what it is given.
        adapted: (36,) room for what it says.
    """

    parameters: FloatVector
    memory: FloatVector
    adapt: int
    rows: IntVector
    y: FloatVector
    HPHt: FloatVector
    R: FloatVector
    adapted: FloatVector


def rule_of(adaptation: object) -> Rule | None:
    """Return the compiled adaptation with an empty memory; None, and one line that says why, where there is none."""
    address = _address(adaptation)
    if address == 0:
        return None
    room = np.zeros((3, 36))
    memory = empty_memory(adaptation)
    return Rule(parameter_vector(adaptation), memory, address, np.zeros(6, dtype=np.int64), np.zeros(6), *room)


@lru_cache(maxsize=256)
def _address(adaptation: Hashable) -> int:
    """The address of its compiled `adapt`, or 0."""
    return made_or_said(lambda: address_of(compiled_method(adaptation, ADAPT)), adaptation) or 0


def made_or_said(make: Callable[[], Made], adaptation: object) -> Made | None:
    """Return what ``make`` compiles of an adaptation; None, and one line that says why, where numba cannot."""
    if not can_compile():
        _notify_plain(adaptation, "NUMBA_DISABLE_JIT is set: numba compiles nothing")
        return None
    from numba.core.errors import NumbaError, UnsupportedBytecodeError  # the second is none of the first

    try:
        return make()
    except (NumbaError, UnsupportedBytecodeError, TypeError) as error:
        _notify_plain(adaptation, first_sentence(str(error)))
        return None


def _notify_plain(adaptation: object, reason: str) -> None:
    notify(f"estimators with {type(adaptation).__name__} run in plain Python: {reason}")


def first_sentence(message: str) -> str:
    """Return the line of numba's message that names the obstacle."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File", "[1"))]
    return (telling or lines or ["numba cannot compile it"])[0]


def call_adapt(rule: Rule, m: int) -> None:
    """Fill the first m m numbers of ``rule.adapted`` from what ``rule`` shows of m rows."""
    seen = rule.parameters, rule.y, rule.HPHt, rule.R, rule.rows, rule.memory, rule.adapted
    fill_by(rule.adapt, seen, (m, len(rule.memory)))
