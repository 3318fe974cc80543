"""One run in whole matrices: for an adaptation that changes the prior covariance or has a gain of its own."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, View, lane, room, row, shared_row
from jerkbench.kalman import EXPOSED, FLOOR, ROUNDING
from jerkbench.kinematic.arguments import Exchange, Model, Packed, Rules, Steps, Whole, packed_of
from jerkbench.kinematic.plugin_call import call_gain, call_prior


def advance(run: Lanes, model: Model, steps: Steps, begin: int, end: int) -> None:
    """Take the transition of each run on over steps ``begin`` to ``end`` (not included)."""
    for step in range(begin, end):
        k = steps.model[step]
        if k >= 0:
            if run.width == 1 or model.A.shape[2] == 1:
                _advance_step(run, shared_row(model.A, k, run, "n n"), shared_row(model.Q, k, run, "n n"))
            else:
                _advance_step(run, row(model.A, k, run, "n n"), row(model.Q, k, run, "n n"))


def show_transition(run: Lanes) -> None:
    """Take the transition on by what `predict` has joined, of the runs in which an update is due."""
    A, Q = room(run, "n n"), room(run, "n n")
    for a in range(run.n):
        for b in range(run.n):
            A[a, b] = chosen(run.due, 0.0, run.gone_A[a, b], 1.0 if a == b else 0.0)
            Q[a, b] = chosen(run.due, 0.0, run.gone_Q[a, b], 0.0)
    _advance_step(run, A, Q)


def _advance_step(run: Lanes, A: View, Q: View) -> None:
    """Make the transition A times what it was, and its noise A Q A' + Q."""
    gone, AQ, n = room(run, "n n"), room(run, "n n"), run.n
    for a in range(n):
        for b in range(n):
            moved = noise = run.zero
            for c in range(n):
                moved += A[a, c] * run.since_A[c, b]
                noise += A[a, c] * run.since_Q[c, b]
            gone[a, b], AQ[a, b] = moved, noise
    for a in range(n):
        for b in range(n):
            noise = run.zero + Q[a, b]
            for c in range(n):
                noise += AQ[a, c] * A[b, c]
            run.since_A[a, b], run.since_Q[a, b] = gone[a, b], noise


def adapt_prior(alone: Lanes, exchange: Exchange, k: int, packed: Packed, rules: Rules, m: int) -> bool:
    """Put the adapted prior covariance of run ``k`` into its place, if it has one; return whether it raised nothing."""
    if rules.prior[k] == 0:
        return True
    whole = whole_of(alone, exchange)
    take_whole(alone, whole)
    _take_transition(alone, whole)
    well = call_prior(alone, rules, k, whole, packed, m)
    put_covariance(alone, whole.answer)
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
    begin_transition(alone)


def begin_transition(run: Lanes) -> None:
    """Make the transition since the last update the identity, and its noise nothing."""
    for a in range(run.n):
        for b in range(run.n):
            run.since_A[a, b] = run.zero + (1.0 if a == b else 0.0)
            run.since_Q[a, b] = run.zero


def put_covariance(alone: Lanes, P: FloatArray) -> None:
    """Put P into the place of the covariance, where half of it lies."""
    for s in range(alone.s):
        for t in range(s + 1):
            alone.P[s, t] = 0.5 * (P[alone.s * s + t] + P[alone.s * t + s])


# The update of a run whose adaptation has a gain of its own, in whole matrices.


def find_gains(run: Lanes, exchange: Exchange, rules: Rules) -> None:
    """Work out the update of the runs that have a gain of their own, from the prior and the adapted R."""
    packed = packed_of(exchange)
    for k in range(run.width):
        alone = lane(run, k)
        exchange.own[k, 0] = 0.0
        if rules.gain[k] == 0 or alone.lost > 0.0:
            continue
        m = _take_used(alone, packed)
        if m > 0:
            whole = whole_of(alone, exchange)
            take_whole(alone, whole)
            well = call_gain(alone, rules, k, whole, packed, m)
            exchange.own[k, 0], exchange.own[k, 1] = 1.0, 0.0 if well else 1.0
            _own_update(alone, exchange.own[k], whole, packed, m)


def _take_used(alone: Lanes, packed: Packed) -> int:
    """Fill rows, innovation and adapted R of the rows that are used; return how many they are."""
    m = 0
    for r in range(6):
        if alone.used[r] > 0.0:
            packed.rows[m], packed.y[m] = r, alone.y[r]
            m += 1
    for i in range(m):
        for j in range(m):
            packed.R[m * i + j] = alone.R[packed.rows[i], packed.rows[j]]
    return m


def _own_update(alone: Lanes, own: FloatArray, whole: Whole, packed: Packed, m: int) -> None:
    """Put x + K y, and (I - K H) P (I - K H)' + K R K', into ``own``; K is the answer of the adaptation.

    I - K H is worked out first, and its rows and columns of states that are not measured are taken as they are: P may
    be 1e16 R after a gap, and where K is one nothing of P may be left. `put_covariance` makes the result symmetric.
    """
    rest, restP, noise = room(alone, "s 6"), room(alone, "s s"), room(alone, "6")
    free, K, n = room(alone, "s"), whole.answer, alone.s
    _fill_rest(n, rest, free, K, packed, m)
    for s in range(n):
        own[2 + s] = whole.x[s]
        for i in range(m):
            own[2 + s] += K[m * s + i] * packed.y[i]
        for t in range(n):
            restP[s, t] = free[s] * whole.P[n * s + t]
            for i in range(m):
                restP[s, t] += rest[s, i] * whole.P[n * packed.rows[i] + t]
    for s in range(n):
        for i in range(m):  # K R
            noise[i] = 0.0
            for j in range(m):
                noise[i] += K[m * s + j] * packed.R[m * j + i]
        for t in range(n):
            total = free[t] * restP[s, t]
            for i in range(m):
                total += restP[s, packed.rows[i]] * rest[t, i] + noise[i] * K[m * t + i]
            own[2 + n + n * s + t] = total
    _note_rounding(n, own, rest, whole, packed, m)


def _fill_rest(n: int, rest: View, free: View, K: FloatArray, packed: Packed, m: int) -> None:
    """Fill the measured columns of I - K H, and 1 for each state that is not measured, else 0."""
    for s in range(n):
        free[s] = 1.0
        for i in range(m):
            measured = 1.0 if packed.rows[i] == s else 0.0
            free[s] -= measured
            rest[s, i] = measured - K[m * s + i]


def _note_rounding(n: int, own: FloatArray, rest: View, whole: Whole, packed: Packed, m: int) -> None:
    """Add rounding to the variances, and note where they are nothing else (`jerkbench.kalman.spread_by`)."""
    for s in range(n):
        finer, spread = 0.0, 0.0
        for i in range(m):
            if packed.rows[i] == s and packed.R[(m + 1) * i] < whole.P[(n + 1) * s]:
                finer = 1.0
        for i in range(m):
            used = rest[s, i] if finer > 0.0 else whole.answer[m * s + i]
            spread += used * used * (whole.P[(n + 1) * packed.rows[i]] + packed.R[(m + 1) * i])
        spread += (1.0 - finer) * whole.P[(n + 1) * s]
        variance = own[2 + n + (n + 1) * s]
        if not variance > ROUNDING * spread:
            own[1] += 1.0
        if variance < EXPOSED * spread:
            own[2 + n + (n + 1) * s] += FLOOR * spread


def put_gains(run: Lanes, exchange: Exchange) -> None:
    """Put these updates into the place of those that the runs would have had."""
    for k in range(run.width):
        if exchange.own[k, 0] > 0.0:
            alone = lane(run, k)
            alone.lost = exchange.own[k, 1]
            for s in range(run.s):
                alone.x[s] = exchange.own[k, 2 + s]
            put_covariance(alone, exchange.own[k, 2 + run.s :])
