"""The call of an adaptation from compiled code, as its author wrote it."""

from collections.abc import Hashable, Sequence
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import ask, fill_by, try_ask, try_fill_by
from jerkbench.compilation.methods import Method, address_of, compiled_method, parameter_vector
from jerkbench.contracts import Adaptation, Fading
from jerkbench.engines.compiled.arguments import Packed, Rules
from jerkbench.engines.compiled.layout import WIDTH
from jerkbench.estimation.adaptation_call import ADAPT, GIVEN
from jerkbench.memory import empty_memory
from jerkbench.optional import wants_truth

FADE = Method("fade", GIVEN, ("m", "size"), (("m", 6),), "")


class Rule(NamedTuple):
    """A compiled adaptation.

    Attributes:
        parameters: its numbers.
        memory_size: how many numbers it remembers.
        adapt: address of its `adapt`.
        fade: address of its `fade`, or 0: it has none.
        wants_truth: whether it gets the true covariance as R.
    """

    parameters: FloatArray
    memory_size: int
    adapt: int
    fade: int
    wants_truth: bool


def rule_of(adaptation: Adaptation) -> Rule:
    """Return the compiled adaptation.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        numba.core.errors.UnsupportedBytecodeError: likewise; it is no NumbaError.
        TypeError: `adapt` is no plain function.
    """
    adapt, fade = _addresses(cast("Hashable", adaptation))
    return Rule(parameter_vector(adaptation), len(empty_memory(adaptation)), adapt, fade, wants_truth(adaptation))


@lru_cache(maxsize=256)
def _addresses(adaptation: Hashable) -> tuple[int, int]:
    adapt = address_of(compiled_method(adaptation, ADAPT))
    return adapt, address_of(compiled_method(adaptation, FADE)) if isinstance(adaptation, Fading) else 0


def call_adapt(rules: Rules, run: int, packed: Packed, m: int) -> bool:
    """Fill the adapted R of ``m`` rows of a run; return whether `adapt` raised no error.

    What it raises in a single run goes on to the caller; of several runs the others go on.
    """
    seen = rules.parameters[run], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[run], packed.adapted
    if WIDTH > 1:
        well: bool = try_fill_by(rules.adapt[run], seen, (m, rules.sizes[run]))
        return well
    fill_by(rules.adapt[run], seen, (m, rules.sizes[run]))
    return True


def call_fade(rules: Rules, run: int, packed: Packed, m: int) -> tuple[bool, float]:
    """Likewise return the factor on the prior covariance."""
    seen = rules.parameters[run], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[run]
    if WIDTH > 1:
        answer: tuple[bool, float] = try_ask(rules.fade[run], seen, (m, rules.sizes[run]))
        return answer
    return True, ask(rules.fade[run], seen, (m, rules.sizes[run]))


def rules_of(rules: Sequence[Rule]) -> Rules:
    """Return the adaptations of all runs as arrays, each with a memory of zeros."""
    width, numbers = len(rules), max(len(rule.parameters) for rule in rules)
    parameters = np.zeros((width, numbers))
    for run, rule in enumerate(rules):
        parameters[run, : len(rule.parameters)] = rule.parameters
    sizes = np.array([rule.memory_size for rule in rules])
    adapt, fade = np.array([rule.adapt for rule in rules]), np.array([rule.fade for rule in rules])
    return Rules(parameters, adapt, fade, np.zeros((width, sizes.max())), sizes)
