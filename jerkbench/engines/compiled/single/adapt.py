"""The adaptation of one run, called as its author wrote it."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.arguments import Kept, Packed, Rule, Steps
from jerkbench.engines.compiled.ask import ask_adapt, ask_fade
from jerkbench.engines.compiled.places import R
from jerkbench.engines.compiled.single.measure import take_adapted, take_reported
from jerkbench.engines.compiled.single.places import COVARIANCE, PRIOR, PRIOR_ROW, S
from jerkbench.engines.compiled.single.update import distance


def adapt_rows(
    m: FloatArray, packed: Packed, steps: Steps, rule: Rule, kept: Kept, which: int, place: int, rows: int
) -> bool:
    """Put the adapted R of ``rows`` rows into its place, and keep the NIS with the reported one.

    Returns:
        Whether the adapted R is the reported one: then the NIS of the update serves as both, and is not kept here.
    """
    fades = rule.fade != 0
    if fades:  # it changes P
        _keep_reported(m, steps, kept, which, place)
    if rows == 6:
        _adapt_six(m, packed, steps.R[which], rule)
        if _unchanged(m, steps.reported, which):
            return not fades
    else:
        _adapt_some(m, packed, steps.R, which, rule, rows)
    if not fades:
        if rows == 6:
            _copy(packed.adapted, 0, m, R)
        _keep_reported(m, steps, kept, which, place)
        if rows == 6:
            _copy(m, R, packed.adapted, 0)
    if rows < 6:
        take_adapted(m, packed, rows)
    return False


def _keep_reported(m: FloatArray, steps: Steps, kept: Kept, which: int, place: int) -> None:
    """Keep the NIS with the R that the receiver reported."""
    take_reported(m, steps.reported, which)
    kept.nis[place] = distance(m)


def _copy(into: FloatArray, at: int, source: FloatArray, begin: int) -> None:
    for e in range(36):
        into[at + e] = source[begin + e]


def _adapt_six(m: FloatArray, packed: Packed, given: FloatArray, rule: Rule) -> None:
    """Call the adaptation with all six rows; what it says goes straight into its place."""
    for i in range(6):
        for j in range(i + 1):
            packed.HPHt[6 * i + j] = packed.HPHt[6 * j + i] = m[PRIOR + PRIOR_ROW * i + j]
    if rule.fade != 0:
        _fade(m, ask_fade(rule, packed, given, 6))
    ask_adapt(rule, packed, given, 6, m[R : R + 36])


def _adapt_some(m: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule, rows: int) -> None:
    """Call the adaptation with the rows that are there."""
    for i in range(rows):
        for j in range(rows):
            packed.HPHt[rows * i + j] = m[PRIOR + PRIOR_ROW * packed.rows[i] + packed.rows[j]]
            packed.R[rows * i + j] = given[which, packed.rows[i], packed.rows[j]]
    if rule.fade != 0:
        _fade(m, ask_fade(rule, packed, packed.R, rows))
    ask_adapt(rule, packed, packed.R, rows, packed.adapted)


def _fade(m: FloatArray, factor: float) -> None:
    """Scale the prior covariance."""
    for e in range(S * PRIOR_ROW):
        m[COVARIANCE + e] *= factor


def _unchanged(m: FloatArray, reported: FloatArray, which: int) -> bool:
    """Whether the adapted R of six rows is the reported one."""
    for r in range(6):
        for c in range(6):
            if m[R + 6 * r + c] != reported[which, r, c]:
                return False
    return True
