"""The call of an adaptation from compiled code, as its author wrote it."""

from collections.abc import Hashable, Sequence
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.methods import (
    Method,
    address_of,
    ask,
    compiled_method,
    fill_by,
    parameter_vector,
    try_ask,
    try_fill_by,
)
from jerkbench.compilation.module_cache import can_compile
from jerkbench.compilation.views import Lanes
from jerkbench.contracts import Adaptation, AdaptingGain, AdaptingPrior, Fading
from jerkbench.kinematic.arguments import Packed, Rules, Whole
from jerkbench.memory import memory_size
from jerkbench.notices import notify
from jerkbench.optional import wants_truth

# The methods as the author of an adaptation writes them: what each is given, and what it returns.

MEASURED = (
    ("innovation", "float64", "m"),
    ("R", "float64", "(m, m)"),
    ("rows", "int64", "m"),
    ("memory", "float64", "size"),
)
GIVEN = (MEASURED[0], ("HPHt", "float64", "(m, m)"), *MEASURED[1:])
STATE = (("x", "float64", "n"), *((name, "float64", "(n, n)") for name in ("P", "F", "Q")))
ADAPT = Method("adapt", GIVEN, ("m", "size"), (("m", 6),), "(m, m)")
FADE = Method("fade", GIVEN, ("m", "size"), (("m", 6),), "")
PRIOR = Method("adapt_prior", (*STATE, *MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, n)")
GAIN = Method("adapt_gain", (*STATE[:2], *MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, m)")


class Rule(NamedTuple):
    """A compiled adaptation.

    Attributes:
        adaptation: itself, which knows how much it remembers.
        parameters: its numbers.
        adapt: address of its `adapt`.
        fade: address of its `fade`, or 0: it has none.
        prior: likewise of its `adapt_prior`.
        gain: likewise of its `adapt_gain`.
        wants_truth: whether it gets the true covariance as R.
    """

    adaptation: Adaptation
    parameters: FloatArray
    adapt: int
    fade: int
    prior: int
    gain: int
    wants_truth: bool

    @property
    def dense(self) -> bool:
        """Whether it sees whole matrices, which a loop of its own shows."""
        return self.prior != 0 or self.gain != 0


IN_PYTHON = "estimators with {} run in plain Python"


def compiled_rule(adaptation: Adaptation, otherwise: str = IN_PYTHON) -> Rule | None:
    """Return the compiled adaptation; None where numba cannot compile it, and one line with the reason.

    ``otherwise``: what that line says of the name of the adaptation.
    """
    if reason := obstacle(cast("Hashable", adaptation)):
        notify(f"{otherwise.format(type(adaptation).__name__)}: {reason}")
        return None
    return Rule(
        adaptation, parameter_vector(adaptation), *_addresses(cast("Hashable", adaptation)), wants_truth(adaptation)
    )


def obstacle(adaptation: Hashable) -> str:
    """Return why numba cannot compile ``adaptation``, or an empty string."""
    return _obstacle(adaptation) if can_compile() else "NUMBA_DISABLE_JIT is set: numba compiles nothing"


@lru_cache(maxsize=256)
def _obstacle(adaptation: Hashable) -> str:
    from numba.core.errors import NumbaError, UnsupportedBytecodeError  # the second is none of the first

    try:
        _addresses(adaptation)
        parameter_vector(adaptation)
    except (NumbaError, UnsupportedBytecodeError, TypeError) as error:
        return _first_sentence(str(error))
    return ""


def _first_sentence(message: str) -> str:
    """The line of numba's message that names the obstacle."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File", "[1"))]
    return (telling or lines or ["numba cannot compile it"])[0]


@lru_cache(maxsize=256)
def _addresses(adaptation: Hashable) -> tuple[int, int, int, int]:
    """Of `adapt`, and of the methods that it may have, 0 where it has not."""

    def address(method: Method) -> int:
        return address_of(compiled_method(adaptation, method))

    fade = address(FADE) if isinstance(adaptation, Fading) else 0
    prior = address(PRIOR) if isinstance(adaptation, AdaptingPrior) else 0
    gain = address(GAIN) if isinstance(adaptation, AdaptingGain) else 0
    return address(ADAPT), fade, prior, gain


def call_adapt(rules: Rules, k: int, packed: Packed, m: int) -> bool:
    """Fill the adapted R of ``m`` rows of run ``k``; return whether `adapt` raised no error.

    What it raises in a single run goes on to the caller; of several runs the others go on.
    """
    seen = rules.parameters[k], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[k], packed.adapted
    if len(rules.adapt) > 1:
        well: bool = try_fill_by(rules.adapt[k], seen, (m, rules.sizes[k]))
        return well
    fill_by(rules.adapt[k], seen, (m, rules.sizes[k]))
    return True


def call_fade(rules: Rules, k: int, packed: Packed, m: int) -> tuple[bool, float]:
    """Return whether `fade` of run ``k`` raised no error, and its factor on the prior covariance."""
    seen = rules.parameters[k], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[k]
    if len(rules.adapt) > 1:
        answer: tuple[bool, float] = try_ask(rules.fade[k], seen, (m, rules.sizes[k]))
        return answer
    return True, ask(rules.fade[k], seen, (m, rules.sizes[k]))


def call_prior(alone: Lanes, rules: Rules, k: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the adapted prior covariance of a run; return whether `adapt_prior` raised no error."""
    given = rules.parameters[k], whole.x, whole.P, whole.F, whole.Q, packed.y, packed.R, packed.rows
    seen = (*given, rules.memory[k], whole.answer)
    if len(rules.adapt) > 1:
        well: bool = try_fill_by(rules.prior[k], seen, (m, rules.sizes[k], alone.s))
        return well
    fill_by(rules.prior[k], seen, (m, rules.sizes[k], alone.s))
    return True


def call_gain(alone: Lanes, rules: Rules, k: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the gain of a run; return whether `adapt_gain` raised no error."""
    seen = rules.parameters[k], whole.x, whole.P, packed.y, packed.R, packed.rows, rules.memory[k], whole.answer
    if len(rules.adapt) > 1:
        well: bool = try_fill_by(rules.gain[k], seen, (m, rules.sizes[k], alone.s))
        return well
    fill_by(rules.gain[k], seen, (m, rules.sizes[k], alone.s))
    return True


def rules_of(rules: Sequence[Rule], states: int) -> Rules:
    """Return the adaptations of all runs, of filters of ``states`` states, as arrays; each memory is zero."""
    parameters = np.zeros((len(rules), max(len(rule.parameters) for rule in rules)))
    for run, rule in enumerate(rules):
        parameters[run, : len(rule.parameters)] = rule.parameters
    sizes = np.array([memory_size(rule.adaptation, states) for rule in rules])
    adapt, fade = np.array([rule.adapt for rule in rules]), np.array([rule.fade for rule in rules])
    prior, gain = np.array([rule.prior for rule in rules]), np.array([rule.gain for rule in rules])
    memory = np.zeros((len(rules), sizes.max()))
    return Rules(parameters, adapt, fade, prior, gain, memory, sizes)
