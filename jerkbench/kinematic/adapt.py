"""The adaptation: it sees one run after the other, as its author wrote it."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.kinematic.arguments import Packed, Rules, Runs
from jerkbench.kinematic.exchange import packed_of, show, take, take_kept
from jerkbench.kinematic.fading import call_fade, fade_prior
from jerkbench.kinematic.gain import NAN
from jerkbench.kinematic.layout import DENSE, LOST, WIDTH
from jerkbench.kinematic.plugin_call import call_adapt
from jerkbench.kinematic.prior import adapt_prior


def adapt_runs(w: FloatArray, numbers: FloatArray, runs: Runs, rules: Rules, complete: bool) -> bool:
    """Put the adapted R of all runs in the place of what the adaptation gets, without rows of no finite variance.

    Args:
        w: the runs, vector by vector.
        numbers: the same, number by number.
        runs: room for what the runs show to the adaptation, and for what it says.
        rules: the adaptation.
        complete: whether all rows of all runs are there.

    Returns:
        Whether neither R nor P has changed.
    """
    show(w, runs)
    some = packed_of(runs)
    for r in range(6):
        runs.rows[r] = r
    same, whole = complete, complete
    for run in range(WIDTH):
        m = 6 if complete else _find_rows(runs.kept[run], runs.rows)
        if numbers[WIDTH * LOST + run] > 0.0:
            m = 0  # what is left of it is nothing to show
            whole = False
            _unpack(runs, run, some, m)
        else:
            whole = _adapt_run(numbers, runs, run, some, rules, m) and whole
        same = same and whole and _leaves_prior(rules, run) and _unchanged(runs.given[run], runs.adapted[run])
    take(w, runs)
    if not whole:
        take_kept(w, runs)
    return same


def _adapt_run(numbers: FloatArray, runs: Runs, run: int, some: Packed, rules: Rules, m: int) -> bool:
    """Adapt R of ``m`` rows of a run; return whether all six are used."""
    if m == 6:
        six = Packed(some.rows, runs.y[run], runs.HPHt[run], runs.given[run], runs.adapted[run])
        _call(numbers, runs, run, six, rules, m)
    else:
        _pack(runs, run, some, m)
        if m > 0:
            _call(numbers, runs, run, some, rules, m)
    whole = m == 6 and _finite(runs.adapted[run], runs.variance[run])
    if not whole:
        _unpack(runs, run, some, m)
    return whole


def _find_rows(kept: FloatArray, rows: IntArray) -> int:
    """Fill the numbers of the rows that are there; return how many they are."""
    m = 0
    for r in range(6):
        if kept[r] > 0.0:
            rows[m] = r
            m += 1
    return m


def _call(numbers: FloatArray, runs: Runs, run: int, packed: Packed, rules: Rules, m: int) -> None:
    """Fade, adapt the prior, then R; a run in which one of them raises an error is lost."""
    well = True
    if rules.fade[run] != 0:
        well, factor = call_fade(rules, run, packed, m)
        fade_prior(numbers, run, packed, factor)
    if DENSE == 1:
        well = adapt_prior(numbers, runs, run, packed, rules, m) and well
    if not (well and call_adapt(rules, run, packed, m)):
        numbers[WIDTH * LOST + run] = 1.0


def _leaves_prior(rules: Rules, run: int) -> bool:
    if DENSE == 1:
        return bool(rules.fade[run] == 0 and rules.prior[run] == 0)
    return bool(rules.fade[run] == 0)


def _unchanged(given: FloatArray, adapted: FloatArray) -> bool:
    e = 0
    while e < 36 and given[e] == adapted[e]:
        e += 1
    return e == 36


def _finite(adapted: FloatArray, variance: FloatArray) -> bool:
    """Note the variances of six rows; return whether all are finite."""
    total = 0.0
    for r in range(6):
        variance[r] = adapted[7 * r]
        total += variance[r] * 0.0
    return total == 0.0


def _pack(runs: Runs, run: int, some: Packed, m: int) -> None:
    """Show the rows that are there."""
    for i in range(m):
        r = some.rows[i]
        some.y[i] = runs.y[run, r]
        for j in range(m):
            c = some.rows[j]
            some.HPHt[m * i + j] = runs.HPHt[run, 6 * r + c]
            some.R[m * i + j] = runs.given[run, 6 * r + c]


def _unpack(runs: Runs, run: int, some: Packed, m: int) -> None:
    """Note the variances; write the adapted R without the rows that have no finite one, and drop these."""
    adapted, variance = runs.adapted[run], runs.variance[run]
    if m == 6:
        for e in range(36):
            some.adapted[e] = adapted[e]
    for e in range(36):
        adapted[e] = 0.0
    for r in range(6):
        variance[r] = NAN
    for i in range(m):
        r = some.rows[i]
        variance[r] = some.adapted[(m + 1) * i]
        if np.isfinite(variance[r]):
            for j in range(m):
                if np.isfinite(some.adapted[(m + 1) * j]):
                    adapted[6 * r + some.rows[j]] = some.adapted[m * i + j]
        else:
            runs.kept[run, r] = 0.0
