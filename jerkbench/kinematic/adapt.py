"""The adaptation: it sees one run after the other, as its author wrote it.

Vectors hold a number of each run, and it wants all numbers of one run: they are spread and gathered around its calls.
An own gain is found likewise; what it does is in `correction`.
"""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, gather, lane, spread
from jerkbench.kinematic.adapt_lanes import clear_gains
from jerkbench.kinematic.arguments import DENSE, Exchange, Packed, Rules, Whole, packed_of
from jerkbench.kinematic.correction import NAN
from jerkbench.kinematic.plugin_call import call_adapt, call_fade, call_gain, call_prior
from jerkbench.kinematic.predict import no_time


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
            whole = False
            _unpack(exchange, k, some, 0)  # what is left of it is nothing to show
        else:
            whole = _adapt_run(alone, exchange, k, some, rules, m) and whole
        keeps_prior = rules.fade[k] == 0 and rules.prior[k] == 0
        same = same and whole and keeps_prior and _unchanged(exchange.given[k], exchange.adapted[k])
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
        own = Packed(some.rows, exchange.y[k], exchange.HPHt[k], exchange.given[k], exchange.adapted[k])
        _call(alone, exchange, k, own, rules, m)
    else:
        _pack(exchange, exchange.given, k, some, m)
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


def _pack(exchange: Exchange, R: FloatArray, k: int, some: Packed, m: int) -> None:
    """Show the rows that are there, with their ``R``."""
    for i in range(m):
        r = some.rows[i]
        some.y[i] = exchange.y[k, r]
        for j in range(m):
            c = some.rows[j]
            some.HPHt[m * i + j] = exchange.HPHt[k, 6 * r + c]
            some.R[m * i + j] = R[k, 6 * r + c]


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


# What an adaptation does to P as a whole: the state of one run in whole matrices.


def adapt_prior(alone: Lanes, exchange: Exchange, k: int, packed: Packed, rules: Rules, m: int) -> bool:
    """Put the adapted prior covariance of run ``k`` into its place, if it has one; return whether it raised nothing."""
    if rules.prior[k] == 0:
        return True
    whole = whole_of(alone, exchange)
    take_whole(alone, whole)
    _take_transition(alone, whole)
    well = call_prior(alone, rules, k, whole, packed, m)
    for s in range(alone.s):
        for t in range(s + 1):
            alone.P[s, t] = 0.5 * (whole.answer[alone.s * s + t] + whole.answer[alone.s * t + s])
    for i in range(m):
        for j in range(m):
            packed.HPHt[m * i + j] = alone.P[packed.rows[i], packed.rows[j]]
    return well


def whole_of(alone: Lanes, exchange: Exchange) -> Whole:
    """Point at the room for the state of one run."""
    own, s = exchange.whole, alone.s
    P, F, Q, answer = s, s + s * s, s + 2 * s * s, s + 3 * s * s
    return Whole(own[:s], own[P:F], own[F:Q], own[Q:answer], own[answer : answer + s * s])


def take_whole(alone: Lanes, whole: Whole) -> None:
    """Fill x and P."""
    for s in range(alone.s):
        whole.x[s] = alone.x[s]
        for t in range(alone.s):
            whole.P[alone.s * s + t] = alone.P[s, t]


def _take_transition(alone: Lanes, whole: Whole) -> None:
    """Fill F and Q, and begin anew with the identity and nothing."""
    n = alone.n
    for e in range(alone.s * alone.s):
        whole.F[e] = whole.Q[e] = 0.0
    for a in range(n):
        for b in range(n):
            for i in range(3):
                e = alone.s * (3 * a + i) + 3 * b + i
                whole.F[e], whole.Q[e] = alone.since_A[a, b], alone.since_Q[a, b]
    no_time(alone, alone.since_A, alone.since_Q)


def find_gains(run: Lanes, exchange: Exchange, rules: Rules) -> None:
    """Put K' of the runs that have a gain of their own into Z, and mark them, from the prior and the adapted R.

    Rows, y and R are those that `adapt_runs` has left in the exchange.
    """
    packed = packed_of(exchange)
    for k in range(run.width):
        alone = lane(run, k)
        m = _find_rows(exchange.kept[k], exchange.rows) if rules.gain[k] != 0 and alone.lost == 0.0 else 0
        if m > 0:
            _pack(exchange, exchange.adapted, k, packed, m)
            whole = whole_of(alone, exchange)
            take_whole(alone, whole)
            clear_gains(alone)
            alone.own = 1.0
            if not call_gain(alone, rules, k, whole, packed, m):
                alone.lost = 1.0
            for i in range(m):
                for s in range(alone.s):
                    alone.Z[packed.rows[i], s] = whole.answer[m * s + i]
