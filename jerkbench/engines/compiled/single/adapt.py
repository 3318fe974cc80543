"""The adaptation of one run, called as its author wrote it."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.arguments import Adapt, Fade, Kept, Packed, Rule, Steps
from jerkbench.engines.compiled.places import PRIOR, PRIOR_ROW
from jerkbench.engines.compiled.single.measure import take_reported
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
    """Fill the adapted R of ``rows`` rows and keep the NIS with the reported one.

    Returns:
        Whether the adapted R is the reported one: then the NIS of the update serves as both, and is not kept here.
    """
    if rule.fades:  # it changes P
        take_reported(m, steps.reported, which)
        kept.nis[place] = distance(m)
    if rows == 6:
        _adapt_six(adapt, fade, m, packed, steps.R, which, rule)
    else:
        _adapt_some(adapt, fade, m, packed, steps.R, which, rule, rows)
    if rule.fades or (rows == 6 and _unchanged(packed, steps.reported, which)):
        return not rule.fades
    take_reported(m, steps.reported, which)
    kept.nis[place] = distance(m)
    return False


def _adapt_six(
    adapt: Adapt, fade: Fade, m: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule
) -> None:
    """Call the adaptation with all six rows."""
    for i in range(6):
        for j in range(6):
            packed.HPHt[6 * i + j] = m[PRIOR + PRIOR_ROW * i + j]
            packed.R[6 * i + j] = given[which, 6 * i + j]
    y, HPHt, reported = packed.y, packed.HPHt_of_six, packed.R_of_six
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
            packed.R[rows * i + j] = given[which, 6 * packed.rows[i] + packed.rows[j]]
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


def _unchanged(packed: Packed, reported: FloatArray, which: int) -> bool:
    """Whether the adapted R of six rows is the reported one."""
    same = True
    for e in range(36):
        same &= packed.adapted[e] == reported[which, e]
    return same
