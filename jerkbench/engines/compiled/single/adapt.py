"""The adaptation of one run, called as its author wrote it."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.arguments import Adapt, Fade, Kept, Packed, Rule, Steps
from jerkbench.engines.compiled.places import PRIOR, PRIOR_ROW, R
from jerkbench.engines.compiled.single.measure import take_adapted, take_reported
from jerkbench.engines.compiled.single.places import COVARIANCE, S
from jerkbench.engines.compiled.single.update import distance


def adapt_rows(
    adapt: Adapt,
    fade: Fade,
    m: FloatArray,
    packed: Packed,
    steps: Steps,
    rule: Rule,
    kept: Kept,
    which: int,
    place: int,
    rows: int,
) -> bool:
    """Put the adapted R of ``rows`` rows into its place, and keep the NIS with the reported one.

    Returns:
        Whether the adapted R is the reported one: then the NIS of the update serves as both, and is not kept here.
    """
    if rule.fades:  # it changes P
        _keep_reported(m, steps, kept, which, place)
    if rows == 6:
        _adapt_six(adapt, fade, m, packed, steps.R, which, rule)
        if _unchanged(packed.adapted_of_six, steps.reported, which):
            return not rule.fades
    else:
        _adapt_some(adapt, fade, m, packed, steps.R, which, rule, rows)
    if not rule.fades:
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


def _adapt_six(
    adapt: Adapt, fade: Fade, m: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule
) -> None:
    """Call the adaptation with all six rows."""
    for i in range(6):
        for j in range(i + 1):
            packed.HPHt[6 * i + j] = packed.HPHt[6 * j + i] = m[PRIOR + PRIOR_ROW * i + j]
    y, HPHt, reported = packed.y, packed.HPHt_of_six, given[which]
    if rule.fades:
        _fade(m, packed, fade(rule.parameters, y, HPHt, reported, packed.rows, rule.memory))
    adapt(rule.parameters, y, HPHt, reported, packed.rows, rule.memory, packed.adapted_of_six)


def _adapt_some(
    adapt: Adapt, fade: Fade, m: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule, rows: int
) -> None:
    """Call the adaptation with the rows that are there."""
    for i in range(rows):
        for j in range(rows):
            packed.HPHt[rows * i + j] = m[PRIOR + PRIOR_ROW * packed.rows[i] + packed.rows[j]]
            packed.R[rows * i + j] = given[which, packed.rows[i], packed.rows[j]]
    y, which_rows = packed.y[:rows], packed.rows[:rows]
    HPHt, reported = packed.HPHt[: rows * rows].reshape(rows, rows), packed.R[: rows * rows].reshape(rows, rows)
    if rule.fades:
        _fade(m, packed, fade(rule.parameters, y, HPHt, reported, which_rows, rule.memory))
    adapted = packed.adapted[: rows * rows].reshape(rows, rows)
    adapt(rule.parameters, y, HPHt, reported, which_rows, rule.memory, adapted)


def _fade(m: FloatArray, packed: Packed, factor: float) -> None:
    """Scale the prior covariance, and what the adaptation will see of it."""
    for e in range(S * PRIOR_ROW):
        m[COVARIANCE + e] *= factor
    for e in range(36):
        packed.HPHt[e] *= factor


def _unchanged(adapted: FloatArray, reported: FloatArray, which: int) -> bool:
    """Whether the adapted R of six rows is the reported one."""
    for r in range(6):
        for c in range(6):
            if adapted[r, c] != reported[which, r, c]:
                return False
    return True
