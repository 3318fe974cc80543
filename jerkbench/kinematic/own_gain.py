"""The update of runs whose adaptation has a gain of its own."""

from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, View, lane, room
from jerkbench.kalman import EXPOSED, FLOOR, ROUNDING
from jerkbench.kinematic.adapt import find_gains
from jerkbench.kinematic.adapt_lanes import find_gains_of_lanes
from jerkbench.kinematic.arguments import ASKED, AT_ONCE, Exchange, Rules
from jerkbench.kinematic.correction import correct


def correct_by_gains(run: Lanes, exchange: Exchange, rules: Rules, states: int) -> None:
    """Update the runs that have a gain of their own by it, with the prior and the adapted R; all others as usual."""
    run.own = run.zero
    if ASKED == AT_ONCE:
        find_gains_of_lanes(run, exchange.rows, rules)
    else:
        find_gains(run, exchange, rules)
    owners = plain = 0.0
    for k in range(run.width):
        owners += lane(run, k).own
        plain += 1.0 - lane(run, k).own
    if owners == 0.0:
        correct(run, states)
        return
    x, P, own = room(run, "s"), room(run, "s s"), run.own
    lost = run.lost + _own_update(run, x, P)
    if plain > 0.0:
        correct(run, states)
    run.lost = chosen(own, 0.0, lost, run.lost)
    for s in range(run.s):
        run.x[s] = chosen(own, 0.0, x[s], run.x[s])
        for t in range(s + 1):
            run.P[s, t] = chosen(own, 0.0, 0.5 * (P[s, t] + P[t, s]), run.P[s, t])


def _own_update(run: Lanes, x: View, P: View) -> float:
    """Fill x + K y, and (I - K H) P (I - K H)' + K R K'; K' stands in Z.

    I - K H is worked out first, and its rows and columns of states that are not measured are taken as they are: P may
    be 1e16 R after a gap, and where K is one nothing of P may be left.

    Returns:
        Above 0 where a variance is nothing but rounding.
    """
    rest, restP, noise, free = room(run, "s 6"), room(run, "s s"), room(run, "6"), room(run, "s")
    _fill_rest(run, rest, free)
    for s in range(run.s):
        x[s] = run.x[s] + _row_times(run.Z, s, run.y)
        for t in range(run.s):
            restP[s, t] = free[s] * run.P[s, t]
            for r in range(6):
                restP[s, t] += rest[s, r] * run.P[r, t]
    for s in range(run.s):
        for r in range(6):  # K R
            noise[r] = run.zero
            for c in range(6):
                noise[r] += run.Z[c, s] * run.R[c, r]
        for t in range(run.s):
            total = free[t] * restP[s, t]
            for r in range(6):
                total += restP[s, r] * rest[t, r] + noise[r] * run.Z[r, t]
            P[s, t] = total
    return _note_rounding(run, rest, P)


def _row_times(Z: View, s: int, y: View) -> float:
    total: float = Z[0, s] * y[0]
    for r in range(1, 6):
        total += Z[r, s] * y[r]
    return total


def _fill_rest(run: Lanes, rest: View, free: View) -> None:
    """Fill the measured columns of I - K H, and 1 for each state that is not measured, else 0."""
    for s in range(run.s):
        measured = run.used[s] if s < 6 else run.zero
        free[s] = 1.0 - measured
        for r in range(6):
            rest[s, r] = (measured if r == s else run.zero) - run.Z[r, s]


def _note_rounding(run: Lanes, rest: View, P: View) -> float:
    """Add rounding to the variances, and return above 0 where one is nothing else (`jerkbench.kalman.spread_by`)."""
    lost: float = run.zero
    for s in range(run.s):
        finer = chosen(run.used[s] * run.P[s, s], run.R[s, s], 1.0, 0.0) if s < 6 else run.zero
        spread = (1.0 - finer) * run.P[s, s]
        for r in range(6):
            used = chosen(finer, 0.0, rest[s, r], run.Z[r, s])
            spread += used * used * (run.P[r, r] + run.R[r, r])
        lost += chosen(P[s, s], ROUNDING * spread, 0.0, 1.0)
        P[s, s] += chosen(EXPOSED * spread, P[s, s], FLOOR * spread, 0.0)
    return lost
