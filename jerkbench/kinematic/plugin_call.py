"""The call of an adaptation from compiled code, as its author wrote it."""

from collections.abc import Hashable, Sequence
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import ask, fill_by, try_ask, try_fill_by
from jerkbench.compilation.methods import Method, address_of, compiled_method, parameter_vector
from jerkbench.contracts import Adaptation, AdaptingGain, AdaptingPrior, Fading
from jerkbench.estimation.adaptation_call import ADAPT, GIVEN, made_or_said
from jerkbench.kinematic.arguments import Packed, Rules
from jerkbench.kinematic.whole_matrices import GAIN, PRIOR
from jerkbench.memory import memory_size
from jerkbench.optional import wants_truth

FADE = Method("fade", GIVEN, ("m", "size"), (("m", 6),), "")
"""As the author of an adaptation writes it: what it is given, and a number that it returns."""


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


def rule_of(adaptation: Adaptation) -> Rule:
    """Return the compiled adaptation.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile it.
        numba.core.errors.UnsupportedBytecodeError: likewise; it is no NumbaError.
        TypeError: `adapt` is no plain function.
    """
    addresses = _addresses(cast("Hashable", adaptation))
    return Rule(adaptation, parameter_vector(adaptation), *addresses, wants_truth(adaptation))


def compiled_rule(adaptation: Adaptation) -> Rule | None:
    """Return the same for an estimator; None, and one line that says why, where numba cannot compile it."""
    return _compiled(cast("Hashable", adaptation))


@lru_cache(maxsize=256)
def _compiled(adaptation: Hashable) -> Rule | None:
    return made_or_said(lambda: rule_of(cast("Adaptation", adaptation)), adaptation)


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
