"""The adaptation: it sees one run after the other, as its author wrote it.

Vectors hold a number of each run, and it wants all numbers of one run: they are spread and gathered around its calls.
What it does to P as a whole (`adapt_prior`, an own gain) is in `whole_matrices`.
"""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, gather, lane, spread
from jerkbench.kinematic.arguments import DENSE, Exchange, Packed, Rules, packed_of
from jerkbench.kinematic.correction import NAN
from jerkbench.kinematic.plugin_call import call_adapt, call_fade
from jerkbench.kinematic.whole_matrices import adapt_prior


def adapt_runs(run: Lanes, exchange: Exchange, rules: Rules, complete: bool) -> bool:
    """Put the adapted R of all runs in the place of what the adaptation gets, without rows of no finite variance.

    Args:
        run: the runs.
        exchange: room for what they show to the adaptation, and for what it says.
        rules: the adaptation.
        complete: whether all rows of all runs are there.

    Returns:
        Whether neither R nor P has changed.
    """
    spread(exchange.HPHt, run.P_measured)
    spread(exchange.given, run.R)
    spread(exchange.y, run.y)
    spread(exchange.kept, run.used)
    some = packed_of(exchange)
    for r in range(6):
        exchange.rows[r] = r
    same, whole = complete, complete
    for k in range(run.width):
        alone = lane(run, k)
        m = 6 if complete else _find_rows(exchange.kept[k], exchange.rows)
        if alone.lost > 0.0:
            m = 0  # what is left of it is nothing to show
            whole = False
            _unpack(exchange, k, some, m)
        else:
            whole = _adapt_run(alone, exchange, k, some, rules, m) and whole
        same = same and whole and _leaves_prior(rules, k) and _unchanged(exchange.given[k], exchange.adapted[k])
    _take(run, exchange, whole)
    return same


def _take(run: Lanes, exchange: Exchange, whole: bool) -> None:
    """Take the adapted R; unless all rows are used the variances and which rows are, too. Then y of the others is 0."""
    gather(run.R, exchange.adapted)
    for r in range(6):
        run.variance[r] = run.R[r, r]
    if not whole:
        gather(run.variance, exchange.variance)
        gather(run.used, exchange.kept)
        for r in range(6):
            run.y[r] = chosen(run.used[r], 0.0, run.y[r], 0.0)


def _adapt_run(alone: Lanes, exchange: Exchange, k: int, some: Packed, rules: Rules, m: int) -> bool:
    """Adapt R of ``m`` rows of run ``k``; return whether all six are used."""
    if m == 6:
        _call(
            alone,
            exchange,
            k,
            Packed(some.rows, exchange.y[k], exchange.HPHt[k], exchange.given[k], exchange.adapted[k]),
            rules,
            m,
        )
    else:
        _pack(exchange, k, some, m)
        if m > 0:
            _call(alone, exchange, k, some, rules, m)
    whole = m == 6 and _finite(exchange.adapted[k], exchange.variance[k])
    if not whole:
        _unpack(exchange, k, some, m)
    return whole


def _find_rows(kept: FloatArray, rows: IntArray) -> int:
    """Fill the numbers of the rows that are there; return how many they are."""
    m = 0
    for r in range(6):
        if kept[r] > 0.0:
            rows[m] = r
            m += 1
    return m


def _call(alone: Lanes, exchange: Exchange, k: int, packed: Packed, rules: Rules, m: int) -> None:
    """Fade, adapt the prior, then R; a run in which one of them raises an error is lost."""
    well = True
    if rules.fade[k] != 0:
        well, factor = call_fade(rules, k, packed, m)
        fade_prior(alone, packed, factor)
    if DENSE == 1:
        well = adapt_prior(alone, exchange, k, packed, rules, m) and well
    if not (well and call_adapt(rules, k, packed, m)):
        alone.lost = 1.0


def fade_prior(alone: Lanes, packed: Packed, factor: float) -> None:
    """Scale the prior covariance, and what the adaptation sees of it."""
    for e in range(36):
        packed.HPHt[e] *= factor
    for p in range(6):
        for a in range(alone.n):
            for b in range(alone.n):
                alone.block[p, a, b] *= factor


def _leaves_prior(rules: Rules, k: int) -> bool:
    if DENSE == 1:
        return bool(rules.fade[k] == 0 and rules.prior[k] == 0)
    return bool(rules.fade[k] == 0)


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


def _pack(exchange: Exchange, k: int, some: Packed, m: int) -> None:
    """Show the rows that are there."""
    for i in range(m):
        r = some.rows[i]
        some.y[i] = exchange.y[k, r]
        for j in range(m):
            c = some.rows[j]
            some.HPHt[m * i + j] = exchange.HPHt[k, 6 * r + c]
            some.R[m * i + j] = exchange.given[k, 6 * r + c]


def _unpack(exchange: Exchange, k: int, some: Packed, m: int) -> None:
    """Note the variances; write the adapted R without the rows that have no finite one, and drop these."""
    adapted, variance = exchange.adapted[k], exchange.variance[k]
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
            exchange.kept[k, r] = 0.0
