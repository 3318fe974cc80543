"""The adaptation of several runs: it sees one run after the other, as its author wrote it."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.arguments import Adapt, Fade, Packed, Rule
from jerkbench.engines.compiled.places import KEPT, ROW, P, R, Y


def adapt_lane(
    adapt: Adapt,
    fade: Fade,
    flat: FloatArray,
    lane: int,
    packed: Packed,
    given: FloatArray,
    at: int,
    rule: Rule,
    seen: FloatArray,
) -> None:
    """Put the adapted R of run ``lane`` in its place.

    Args:
        adapt: the adaptation.
        fade: its factor on the prior covariance.
        flat: w, number by number.
        lane: which run.
        packed: room.
        given: number by number, the R that the adaptation gets.
        at: where the 21 vectors of its lower triangle begin.
        rule: parameters and memory.
        seen: (SEEN, WIDTH) gets the number of rows kept, and the diagonal of R.
    """
    m = _pack(flat, lane, packed, given, at + lane)
    if m == 6:
        _adapt_six(adapt, fade, flat, lane, packed, rule)
    elif m > 0:
        _adapt_some(adapt, fade, flat, lane, packed, rule, m)
    kept = _find_kept(packed, m, seen, lane)
    seen[2, lane] = kept
    if kept == 6:
        for e in range(36):
            flat[(R + e) * WIDTH + lane] = packed.adapted[e]
    else:
        _unpack(flat, lane, packed, m)


def _adapt_six(adapt: Adapt, fade: Fade, flat: FloatArray, lane: int, packed: Packed, rule: Rule) -> None:
    y, HPHt, reported = packed.y, packed.HPHt_of_six, packed.R_of_six
    if rule.fades:
        _fade(flat, lane, packed, fade(rule.parameters, y, HPHt, reported, packed.rows, rule.memory))
    adapt(rule.parameters, y, HPHt, reported, packed.rows, rule.memory, packed.adapted_of_six)


def _adapt_some(adapt: Adapt, fade: Fade, flat: FloatArray, lane: int, packed: Packed, rule: Rule, m: int) -> None:
    y, rows = packed.y[:m], packed.rows[:m]
    HPHt, reported = packed.HPHt[: m * m].reshape(m, m), packed.R[: m * m].reshape(m, m)
    if rule.fades:
        _fade(flat, lane, packed, fade(rule.parameters, y, HPHt, reported, rows, rule.memory))
    adapt(rule.parameters, y, HPHt, reported, rows, rule.memory, packed.adapted[: m * m].reshape(m, m))


def _pack(flat: FloatArray, lane: int, packed: Packed, given: FloatArray, at: int) -> int:
    """Take innovation, H P H' and R of the rows that are there; returns their number."""
    m = 0
    for r in range(6):
        if flat[(KEPT + r) * WIDTH + lane] > 0.0:
            packed.rows[m] = r
            packed.y[m] = flat[(Y + r) * WIDTH + lane]
            m += 1
    if m == 6:
        _pack_six(flat, lane, packed, given, at)
    else:
        _pack_some(flat, lane, packed, given, at, m)
    return m


def _pack_six(flat: FloatArray, lane: int, packed: Packed, given: FloatArray, at: int) -> None:
    e = at
    for r in range(6):
        for c in range(r + 1):
            prior, reported = flat[(P + ROW * r + c) * WIDTH + lane], given[e]
            packed.HPHt[6 * r + c] = packed.HPHt[6 * c + r] = prior
            packed.R[6 * r + c] = packed.R[6 * c + r] = reported
            e += WIDTH


def _pack_some(flat: FloatArray, lane: int, packed: Packed, given: FloatArray, at: int, m: int) -> None:
    for i in range(m):
        r = packed.rows[i]
        for j in range(i + 1):
            c = packed.rows[j]
            prior, reported = flat[(P + ROW * r + c) * WIDTH + lane], given[at + (r * (r + 1) // 2 + c) * WIDTH]
            packed.HPHt[m * i + j] = packed.HPHt[m * j + i] = prior
            packed.R[m * i + j] = packed.R[m * j + i] = reported


def _fade(flat: FloatArray, lane: int, packed: Packed, factor: float) -> None:
    """Scale the prior covariance, and what the adaptation will see of it."""
    for e in range(ROW * ROW):
        flat[(P + e) * WIDTH + lane] *= factor
    for e in range(36):
        packed.HPHt[e] *= factor


def _find_kept(packed: Packed, m: int, seen: FloatArray, lane: int) -> int:
    """Return how many rows have a finite variance; note the variances."""
    kept = 0
    for i in range(m):
        variance = packed.adapted[(m + 1) * i]
        seen[10 + packed.rows[i], lane] = variance
        if np.isfinite(variance):
            kept += 1
    return kept


def _unpack(flat: FloatArray, lane: int, packed: Packed, m: int) -> None:
    """Write the adapted R without the rows that have an infinite variance, and drop these."""
    for e in range(36):
        flat[(R + e) * WIDTH + lane] = 0.0
    for i in range(m):
        r = packed.rows[i]
        if np.isfinite(packed.adapted[(m + 1) * i]):
            for j in range(m):
                if np.isfinite(packed.adapted[(m + 1) * j]):
                    flat[(R + 6 * r + packed.rows[j]) * WIDTH + lane] = packed.adapted[m * i + j]
        else:
            flat[(KEPT + r) * WIDTH + lane] = 0.0
            flat[(Y + r) * WIDTH + lane] = 0.0
