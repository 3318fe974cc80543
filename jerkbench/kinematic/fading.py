"""Fading: the factor of an adaptation's `fade`, and the prior covariance that is scaled by it.

What an adaptation does to P element by element (`adapt_prior`) is in `prior`; a rule that sees or gives whole matrices
is `dense` (`plugin_call`).
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import ask, try_ask
from jerkbench.compilation.methods import Method
from jerkbench.estimation.adaptation_call import GIVEN
from jerkbench.kinematic.arguments import Packed, Rules
from jerkbench.kinematic.layout import ELEMENT, PAIR, SIZE, WIDTH, B

FADE = Method("fade", GIVEN, ("m", "size"), (("m", 6),), "")
"""As the author of an adaptation writes it: what it is given, and a number that it returns."""


def call_fade(rules: Rules, run: int, packed: Packed, m: int) -> tuple[bool, float]:
    """Return whether `fade` of a run raised no error, and its factor on the prior covariance."""
    seen = rules.parameters[run], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[run]
    if WIDTH > 1:
        answer: tuple[bool, float] = try_ask(rules.fade[run], seen, (m, rules.sizes[run]))
        return answer
    return True, ask(rules.fade[run], seen, (m, rules.sizes[run]))


def fade_prior(numbers: FloatArray, run: int, packed: Packed, factor: float) -> None:
    """Scale the prior covariance, and what the adaptation sees of it."""
    for e in range(36):
        packed.HPHt[e] *= factor
    for p in range(6):
        for e in range(SIZE):
            numbers[(B + PAIR * p + ELEMENT * e) * WIDTH + run] *= factor
