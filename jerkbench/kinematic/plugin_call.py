"""The call of an adaptation from compiled code, as its author wrote it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, Keyed
from jerkbench.compilation.code_digest import own_function, reads
from jerkbench.compilation.methods import (
    CompiledMethod,
    address_of,
    ask,
    compiled_method,
    compiled_shape,
    fill_by,
    parameter_vector,
    try_ask,
    try_fill_by,
    whole_numbers,
)
from jerkbench.compilation.module_cache import can_compile
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import Lanes
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    Fading,
    asked_in_lanes,
    changes_nothing,
    memory_size,
    wants_truth,
)
from jerkbench.kinematic.arguments import AT_ONCE, EACH, Packed, Rules, Whole
from jerkbench.notices import notify

# The methods as the author of an adaptation writes them: what each is given, and what it returns.

_MEASURED = (
    ("innovation", "float64", "m"),
    ("R", "float64", "(m, m)"),
    ("rows", "int64", "m"),
    ("memory", "float64", "size"),
)
GIVEN = (_MEASURED[0], ("HPHt", "float64", "(m, m)"), *_MEASURED[1:])
STATE = (("x", "float64", "n"), *((name, "float64", "(n, n)") for name in ("P", "F", "Q")))
ADAPT = CompiledMethod("adapt", GIVEN, ("m", "size"), (("m", 6),), "(m, m)")
FADE = CompiledMethod("fade", GIVEN, ("m", "size"), (("m", 6),), "")
PRIOR = CompiledMethod("adapt_prior", (*STATE, *_MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, n)")
GAIN = CompiledMethod("adapt_gain", (*STATE[:2], *_MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, m)")


@dataclass(frozen=True, eq=False)
class Rule:
    """An adaptation that compiles.

    Attributes:
        adaptation: itself, which knows how much it remembers.
        parameters: its numbers.
        kind: what it is but for its numbers.
        asked: by whom, side by side: EACH or AT_ONCE of `jerkbench.kinematic.arguments`. A rule that changes nothing is
            not called; it shares the loop of the rules that are called at once.
        wants_truth: whether it gets the true covariance as R.
    """

    adaptation: Adaptation
    parameters: FloatArray
    kind: "_Kind"
    asked: int
    wants_truth: bool

    @cached_property
    def dense(self) -> bool:
        """Whether it sees whole matrices, which a loop of its own shows."""
        _, _, prior, gain = _addresses(self.kind, self.asked == AT_ONCE)
        return prior != 0 or gain != 0

    @cached_property
    def by_axes(self) -> bool:
        """Whether it sees no whole matrices, or goes over them axis by axis where it may."""
        return not self.dense or _reads_axes(type(self.adaptation))

    @cached_property
    def together(self) -> object:
        """Equal for rules that may run side by side; None if the rule is called for each run."""
        if changes_nothing(self.adaptation):
            return type(self.adaptation)
        return (self.kind, tuple(whole_numbers(self.adaptation))) if self.asked else None


@cache
def _reads_axes(kind: type[Adaptation]) -> bool:
    methods = (own_function(getattr(kind, method.name, None)) for method in (ADAPT, PRIOR, GAIN))
    return any(method is not None and reads(method, "AXES") for method in methods)


IN_PYTHON = "estimators with {} run in plain Python"


def compiled_rule(adaptation: Adaptation, otherwise: str = IN_PYTHON, *, side_by_side: bool = False) -> Rule | None:
    """Return the compiled adaptation; None where numba cannot compile it, and one line with the reason.

    Args:
        adaptation: the adaptation.
        otherwise: what that line says of its name.
        side_by_side: whether a loop that asks for all runs at once (`jerkbench.kinematic.adapt_lanes`) is to call it.
    """
    kind, lanes = _Kind(adaptation), side_by_side and asked_in_lanes(adaptation)
    if changes_nothing(adaptation) and can_compile():
        return Rule(adaptation, np.empty(0), kind, AT_ONCE if side_by_side else EACH, wants_truth(adaptation))
    if lanes and (reason := _obstacle(kind, lanes=True)) and not _obstacle(kind, lanes=False):
        notify(f"{type(adaptation).__name__} is asked by each run, not by eight at once: {reason}")
        lanes = False
    if reason := _obstacle(kind, lanes):
        notify(f"{otherwise.format(type(adaptation).__name__)}: {reason}")
        return None
    asked = AT_ONCE if lanes else EACH
    return Rule(adaptation, parameter_vector(adaptation), kind, asked, wants_truth(adaptation))


def obstacle(adaptation: Adaptation) -> str:
    """Return why numba cannot compile ``adaptation``; or an empty string."""
    return _obstacle(_Kind(adaptation), lanes=False)


class _Kind(Keyed):
    """An adaptation but for its numbers, which are handed over with each call: equal ones are compiled alike."""

    def __init__(self, adaptation: Adaptation) -> None:
        super().__init__((type(adaptation), compiled_shape(adaptation)))
        self.example = adaptation


@lru_cache(maxsize=256)
def _obstacle(kind: _Kind, lanes: bool) -> str:
    """Return why numba cannot compile it by itself, or for all runs at once."""
    from numba.core.errors import NumbaError, UnsupportedBytecodeError  # the second is none of the first

    if not can_compile():
        return "NUMBA_DISABLE_JIT is set: numba compiles nothing"
    try:
        _addresses(kind, lanes)
        parameter_vector(kind.example)
    except (NumbaError, UnsupportedBytecodeError, TypeError) as error:
        return _first_sentence(str(error))
    return ""


def _first_sentence(message: str) -> str:
    """The line of numba's message that names the obstacle."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File", "[1"))]
    return (telling or lines or ["numba cannot compile it"])[0]


@lru_cache(maxsize=256)
def _addresses(kind: _Kind, lanes: bool, axes: int = 1, states: int = 9) -> tuple[int, int, int, int]:
    """Of `adapt`, and of the methods that it may have, 0 where it has not; quickest for so many ``states``."""
    own = kind.example
    if changes_nothing(own):
        return 0, 0, 0, 0

    def address(method: CompiledMethod) -> int:
        usual = tuple((name, states if name == "n" else size) for name, size in method.usual)
        return address_of(compiled_method(own, method._replace(usual=usual), WIDE if lanes else 1, axes))

    fade = address(FADE) if isinstance(own, Fading) else 0
    prior = address(PRIOR) if isinstance(own, AdaptingPrior) else 0
    gain = address(GAIN) if isinstance(own, AdaptingGain) else 0
    return address(ADAPT), fade, prior, gain


def _call(address: int, seen: Any, sizes: Any, several: bool) -> bool:  # noqa: ANN401 - tuples of any length
    """Call a method that fills an array; return whether it raised no error.

    What it raises in a single run goes on to the caller; of several runs the others go on.
    """
    if several:
        return bool(try_fill_by(address, seen, sizes))
    fill_by(address, seen, sizes)
    return True


def call_adapt(rules: Rules, k: int, packed: Packed, m: int) -> bool:
    """Fill the adapted R of ``m`` rows of run ``k``; return whether `adapt` raised no error."""
    seen = rules.parameters[k], packed.y, packed.HPHt, packed.R, packed.rows, rules.memory[k], packed.adapted
    return _call(rules.adapt[k], seen, (m, rules.sizes[k]), len(rules.adapt) > 1)


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
    return _call(rules.prior[k], seen, (m, rules.sizes[k], alone.s), len(rules.adapt) > 1)


def call_gain(alone: Lanes, rules: Rules, k: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the gain of a run; return whether `adapt_gain` raised no error."""
    seen = rules.parameters[k], whole.x, whole.P, packed.y, packed.R, packed.rows, rules.memory[k], whole.answer
    return _call(rules.gain[k], seen, (m, rules.sizes[k], alone.s), len(rules.adapt) > 1)


def rules_of(rules: Sequence[Rule], states: int, axes: int = 1) -> Rules:
    """Return the adaptations of all runs, of filters of ``states`` states, as arrays; each memory is zero.

    ``axes``: how many have nothing to do with each other; it tells those that all runs ask at once.
    """
    known = _rules_of(tuple(rules), states, axes)
    return known._replace(memory=aligned_zeros(*known.memory.shape))


@lru_cache(maxsize=16)
def _rules_of(rules: tuple[Rule, ...], states: int, axes: int) -> Rules:
    """The same, but that of the memory only the shape counts: the packs of a sweep ask for the same again and again."""
    first, lanes = rules[0], rules[0].asked == AT_ONCE and len(rules) == WIDE
    sizes = np.array([memory_size(rule.adaptation, states) for rule in rules])
    if lanes:
        sizes[:] = sizes.max()
    way = (axes, states) if lanes else ()
    adapt, fade, prior, gain = np.array([_addresses(rule.kind, lanes, *way) for rule in rules]).T.copy()
    whole = np.array(whole_numbers(first.adaptation) if lanes else [], dtype=np.int64)
    most = max(len(rule.parameters) for rule in rules)
    parameters = aligned_zeros(*((most, len(rules)) if lanes else (len(rules), most)))
    for run, rule in enumerate(rules):
        (parameters.T if lanes else parameters)[run, : len(rule.parameters)] = rule.parameters
    memory = np.empty((max(1, 2 * sizes.max()), WIDE) if lanes else (len(rules), sizes.max()))
    return Rules(parameters, whole, adapt, fade, prior, gain, memory, sizes)
