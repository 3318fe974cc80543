"""The adaptation, called as its author wrote it."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import ask, fill_by
from jerkbench.engines.compiled.arguments import Packed, Rule


def ask_adapt(rule: Rule, packed: Packed, given: FloatArray, m: int, into: FloatArray) -> None:
    """Fill the first m m numbers of ``into`` with the adapted R of m rows; ``given`` is what was reported."""
    arrays = rule.parameters, packed.y, packed.HPHt, given, packed.rows, rule.memory, into
    fill_by(rule.adapt, arrays, (m, len(rule.memory)))


def ask_fade(rule: Rule, packed: Packed, given: FloatArray, m: int) -> float:
    """Return the factor on the prior covariance; what the adaptation sees of that is scaled, too."""
    arrays = rule.parameters, packed.y, packed.HPHt, given, packed.rows, rule.memory
    factor: float = ask(rule.fade, arrays, (m, len(rule.memory)))
    for e in range(36):
        packed.HPHt[e] *= factor
    return factor
