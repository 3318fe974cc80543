"""The measurement update, in a form that rounding harms no more than it must.

With W = H P, S = H P H' + R and v = S^-1 y it holds for the states that are measured that

    x + K y = x + W' v = x + y - R v
    posterior = P - W' S^-1 W = R - R S^-1 R = R S^-1 W

The factors of S are those of S + E, |E_ij| < eps sqrt(S_ii S_jj), and A' S^-1 B errs by A' S^-1 E S^-1 B: the smaller A
and B, the less, and nothing large is to be taken away from anything large (after a gap P may be 1e12 R). So an update
starts from, and each state has as its column G,

    x + y,    R,    G = -R    of a measured state where R < P;    x,    P,    G = W    of all others

and from a covariance of 0 between a state of one kind and one of the other. With S = L D L', Y = L^-1 G and
w = L^-1 y, what is added to x is then G' S^-1 y = Y' D^-1 w, and what is taken from P is G' S^-1 G = Y' D^-1 Y: half of
a solution is enough. Z = S^-1 G, the gains, are solved for where somebody reads them.

Rounding is told from information as in `jerkbench.kalman`. A loop over what one row or state has to do with takes each
STRIDE-th: all, or those of its axis.
"""

from jerkbench.compilation.vectors import anywhere, chosen
from jerkbench.compilation.views import Lanes, View, copy, eights, room, wide_room
from jerkbench.kalman import EXPOSED, FLOOR, INDEFINITE, ROUNDING, SYMMETRIC
from jerkbench.kinematic.arguments import STRIDE

# S = H P H' + R = L D L' of the rows that are used, and what is divided by it.

UNEQUAL = SYMMETRIC * SYMMETRIC
"""How much of S_ii S_jj the square of a difference may be."""

NAN = float("nan")


def mahalanobis(run: Lanes) -> float:
    """Return y' S^-1 y of the rows that are used; NaN where the run is lost.

    It is lost by an S that is not symmetric and positive definite beyond rounding.
    """
    _factorise(run, 0)
    if STRIDE > 1:
        _factorise(run, 1)
        _factorise(run, 2)
    total = run.zero
    for r in range(6):  # y' S^-1 y = |D^-1/2 L^-1 y|^2
        total += run.white[r] * run.white[r] * run.over_D[r]
    distance: float = chosen(run.lost, 0.0, NAN, total)
    return distance


def determinant(run: Lanes) -> float:
    """Return det S of the rows that are used, from the factors that `mahalanobis` has found."""
    product: float = run.over_D[0]
    for r in range(1, 6):
        product *= run.over_D[r]
    return 1.0 / product


def _factorise(run: Lanes, first: int) -> None:
    """S = L D L' and L^-1 y of every STRIDE-th row from the ``first`` on; one not used is a row of the identity.

    No root is drawn: one division follows the other, and each step waits for them.
    """
    M, lost = room(run, "6 6"), run.lost  # L D
    for r in range(first, 6, STRIDE):
        used, rest = run.used[r], run.y[r]
        diagonal = pivot = used * (run.P[r, r] + run.R[r, r]) + (1.0 - used)
        for c in range(first, r, STRIDE):
            both = used * run.used[c]
            apart = both * (run.R[r, c] - run.R[c, r])
            lost += chosen(apart * apart, UNEQUAL * diagonal * run.S_diagonal[c], 1.0, 0.0)
            M[r, c] = both * (run.P[r, c] + run.R[r, c])
            for j in range(first, c, STRIDE):
                M[r, c] -= run.L[r, j] * M[c, j]
            run.L[r, c] = M[r, c] * run.over_D[c]
            pivot -= run.L[r, c] * M[r, c]
            rest -= run.L[r, c] * run.white[c]
        lost += chosen(pivot, ROUNDING * diagonal, 0.0, 1.0)
        run.S_diagonal[r], run.over_D[r], run.white[r] = diagonal, 1.0 / pivot, rest
    run.lost = lost


def solve_gains(run: Lanes) -> None:
    """Make Z = S^-1 G of Y = L^-1 G, which `correct` has left."""
    for s in range(run.s):
        for r in range(s % STRIDE, 6, STRIDE):
            run.Z[r, s] = run.Y[r, s]
        solve_back(run, run.Z, s, s % STRIDE)


def solve_back(run: Lanes, Y: View, s: int, first: int = 0) -> None:
    """Make of column ``s`` of Y that of L^-1' D^-1 Y; rows ``first``, ``first`` + STRIDE, ... take part."""
    for r in range(6 - STRIDE + first, -1, -STRIDE):
        Y[r, s] *= run.over_D[r]
        for j in range(6 - STRIDE + first, r, -STRIDE):
            Y[r, s] -= run.L[j, r] * Y[j, s]


def solve_forward(run: Lanes, G: View, s: int, first: int = 0) -> None:
    """Make of column ``s`` of G that of L^-1 G; likewise."""
    for r in range(first + STRIDE, 6, STRIDE):
        for j in range(first, r, STRIDE):
            G[r, s] -= run.L[r, j] * G[j, s]


BOUND = 4.0 * EXPOSED
"""More than (1 + e) EXPOSED (`_may_be_rounding`)."""


def correct(run: Lanes, states: int) -> None:
    """Update state and covariance with the rows that are used; leaves Y, and which states are ``fine``.

    ``states`` is their number: as a constant it would make the compiler unroll the loops, and use the stack for what no
    longer fits into registers. Axis by axis little is left to unroll.
    """
    taken_from = room(run, "s")  # each variance of the posterior is what is left of this one
    some_fine = _find_fine(run, taken_from)
    if run.width == 1:
        _correct_pairs(run, states, some_fine)
    else:
        _correct_states(run, 0, states if STRIDE == 1 else run.s, some_fine)
        if STRIDE > 1:
            _correct_states(run, 1, run.s, some_fine)
            _correct_states(run, 2, run.s, some_fine)
    if _may_be_rounding(run, taken_from):
        _widen(run, taken_from)


def _find_fine(run: Lanes, taken_from: View) -> bool:
    """Find where R is the finer, and so what the posterior is taken from; return whether it is so anywhere."""
    fine = run.zero
    for s in range(6):
        run.fine[s] = chosen(run.used[s] * run.P[s, s], run.R[s, s], 1.0, 0.0)
        taken_from[s] = chosen(run.fine[s], 0.0, run.R[s, s], run.P[s, s])
        fine += run.fine[s]
    for s in range(6, run.s):
        taken_from[s] = run.P[s, s]
    return bool(anywhere(fine))


def _correct_states(run: Lanes, first: int, states: int, some_fine: bool) -> None:
    """Update every STRIDE-th state from the ``first`` on."""
    _fill_columns(run, first, states)
    if some_fine:
        _start_from_noise(run, first)
    for s in range(first, 6, STRIDE):
        solve_forward(run, run.Y, s, first)
    for s in range(6 + first, states, STRIDE):
        solve_forward(run, run.Y, s, first)
    for s in range(first, 6, STRIDE):
        _correct_state(run, s, first)
    for s in range(6 + first, states, STRIDE):
        _correct_state(run, s, first)


def _correct_state(run: Lanes, s: int, first: int) -> None:
    """Take Y' D^-1 Y from row ``s`` of P, and add Y' D^-1 w to its state: first to y, as `jerkbench.kalman.moved`."""
    scaled, moved = room(run, "6"), run.zero
    for r in range(first, 6, STRIDE):
        scaled[r] = run.Y[r, s] * run.over_D[r]
        moved += scaled[r] * run.white[r]
    run.x[s] += moved + run.fine[s] * run.y[s] if s < 6 else moved
    for t in range(first, s + 1, STRIDE):
        for r in range(first, 6, STRIDE):
            run.P[s, t] -= scaled[r] * run.Y[r, t]


def _fill_columns(run: Lanes, first: int, states: int) -> None:
    """Put G into Y."""
    for r in range(first, 6, STRIDE):
        for s in range(first, 6, STRIDE):
            run.Y[r, s] = chosen(run.fine[s], 0.0, 0.0 - run.R[s, r], run.P[r, s] * run.used[r])
        for s in range(6 + first, states, STRIDE):
            run.Y[r, s] = run.P[r, s] * run.used[r]


def _start_from_noise(run: Lanes, first: int) -> None:
    """Put that in the place of P which something is taken from where R is the finer: R and 0."""
    for s in range(first, 6, STRIDE):
        for t in range(first, s + 1, STRIDE):
            neither, both = (1.0 - run.fine[s]) * (1.0 - run.fine[t]), run.fine[s] * run.fine[t]
            run.P[s, t] = neither * run.P[s, t] + both * run.R[s, t]
    for s in range(6 + first, run.s, STRIDE):
        for t in range(first, 6, STRIDE):
            run.P[s, t] *= 1.0 - run.fine[t]


def _correct_pairs(run: Lanes, states: int, some_fine: bool) -> None:
    """Update one run, all pairs of axes at once: Y stands there with the first axis of each, and the second."""
    of_first, of_second, moved = room(run, "6 n 8"), room(run, "6 n 8"), room(run, "n 8")
    Y, twin, scaled, step = run.Y_pairs, eights(of_second), wide_room(run, "6"), eights(moved)
    if some_fine:
        _fill_columns(run, 0, states)
        _start_from_noise(run, 0)
        copy(of_first, run.Y_first)
    else:
        copy(of_first, run.W_first)
    for a in range(run.n):
        for r in range(6):
            Y[r, a] = run.used[r] * eights(of_first)[run.n * r + a]
        solve_forward(run, Y, a)
    copy(of_second, run.Y_second)
    for a in range(run.n):
        step[a] = 0.0
        for r in range(6):
            scaled[r] = Y[r, a] * run.over_D[r]
            step[a] += scaled[r] * run.white[r]
        for b in range(run.n):
            for r in range(6):
                run.pairs[a, b] -= scaled[r] * twin[run.n * r + b]
            if b < a:  # of an axis with itself both halves are to be the same, for a step goes on from both
                run.pairs[a, b] = chosen(run.same, 0.5, run.pairs[b, a], run.pairs[a, b])
    for s in range(run.s):
        by = moved[s // 3, s % 3 * (7 - s % 3) // 2]
        run.x[s] += by + run.fine[s] * run.y[s] if s < 6 else by


def _may_be_rounding(run: Lanes, taken_from: View) -> bool:
    """Whether `_widen` may have something to do, of a run that is not lost.

    Of G' Z = Z' S Z = ``taken_from`` - posterior, with C the matrix of S's correlations and of m rows, it holds that

        sum_i Z_i^2 S_ii <= Z' S Z / eigenvalue(C),    eigenvalue(C) >= det C ((m - 1) / m)^(m - 1) > det C / e

    because the other eigenvalues of C have a mean of at most m / (m - 1). So what the posterior is left of is less than
    (1 + e) / det C times ``taken_from``.
    """
    factor: float = BOUND * run.over_D[0] * run.S_diagonal[0]
    for r in range(1, 6):
        factor *= run.over_D[r] * run.S_diagonal[r]
    doubt = run.zero
    for s in range(run.s):
        doubt += chosen(run.P[s, s], factor * taken_from[s], 0.0, 1.0)
    run.doubt = chosen(run.lost, 0.0, 0.0, doubt)
    return bool(anywhere(run.doubt))


def _widen(run: Lanes, taken_from: View) -> None:
    """Add rounding to the variances (`jerkbench.kalman.spread_by`); lost where one is nothing else."""
    lost = run.lost
    solve_gains(run)
    for s in range(run.s):
        variance, spread = run.P[s, s], taken_from[s]
        if s < 6:
            spread = (1.0 - run.fine[s]) * spread
        for r in range(s % STRIDE, 6, STRIDE):
            spread += run.Z[r, s] * run.Z[r, s] * run.S_diagonal[r]
        lost += chosen(variance, ROUNDING * spread, 0.0, 1.0)
        run.P[s, s] = variance + chosen(EXPOSED * spread, variance, FLOOR * spread, 0.0)
    run.lost = lost


def check_definite(run: Lanes) -> None:
    """Lost where the covariance has no factors L D L' with D > 0 but for rounding, or the state is no number."""
    C, lost = room(run, "s s"), run.lost
    for s in range(run.s):
        lost += chosen(1.0, run.x[s] * 0.0, 0.0, 1.0)
        for t in range(s, run.s, STRIDE):
            C[s, t] = run.P[s, t]
        C[s, s] *= 1.0 + INDEFINITE
    for first in range(0, run.s, 3):
        lost = _eliminate(C, first, run.s, lost)
    run.lost = lost


def _eliminate(C: View, first: int, s: int, lost: float) -> float:
    """Eliminate three columns, of the upper triangle; return ``lost``, and more where a pivot is not positive."""
    for c in range(first, min(first + 3, s)):
        lost += chosen(C[c, c], 0.0, 0.0, 1.0)
        scale = 1.0 / C[c, c]
        for r in range(c + STRIDE, s, STRIDE):
            factor = C[c, r] * scale
            for j in range(r, s, STRIDE):
                C[r, j] -= factor * C[c, j]
    return lost


# The update of runs whose adaptation has a gain of its own.


def correct_by_gains(run: Lanes, states: int) -> None:
    """Update the runs that have an ``own`` gain by it, with the prior and the adapted R; all others as usual."""
    if not anywhere(run.own):
        correct(run, states)
        return
    x, P, own = room(run, "s"), room(run, "s s"), run.own
    lost = run.lost + _own_update(run, x, P)
    if anywhere(1.0 - own):
        correct(run, states)
    run.lost = chosen(own, 0.0, lost, run.lost)
    for s in range(run.s):
        run.x[s] = chosen(own, 0.0, x[s], run.x[s])
        for t in range(s % STRIDE, s + 1, STRIDE):
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
        x[s] = run.x[s]
        for r in range(s % STRIDE, 6, STRIDE):
            x[s] += run.Z[r, s] * run.y[r]
        for t in range(s % STRIDE, run.s, STRIDE):
            restP[s, t] = free[s] * run.P[s, t]
            for r in range(s % STRIDE, 6, STRIDE):
                restP[s, t] += rest[s, r] * run.P[r, t]
    for s in range(run.s):
        for r in range(s % STRIDE, 6, STRIDE):  # K R
            noise[r] = run.zero
            for c in range(s % STRIDE, 6, STRIDE):
                noise[r] += run.Z[c, s] * run.R[c, r]
        for t in range(s % STRIDE, run.s, STRIDE):
            total = free[t] * restP[s, t]
            for r in range(s % STRIDE, 6, STRIDE):
                total += restP[s, r] * rest[t, r] + noise[r] * run.Z[r, t]
            P[s, t] = total
    return _note_rounding(run, rest, P)


def _fill_rest(run: Lanes, rest: View, free: View) -> None:
    """Fill the measured columns of I - K H, and 1 for each state that is not measured, else 0."""
    for s in range(run.s):
        measured = run.used[s] if s < 6 else run.zero
        free[s] = 1.0 - measured
        for r in range(s % STRIDE, 6, STRIDE):
            rest[s, r] = (measured if r == s else run.zero) - run.Z[r, s]


def _note_rounding(run: Lanes, rest: View, P: View) -> float:
    """Add rounding to the variances, and return above 0 where one is nothing else (`jerkbench.kalman.spread_by`)."""
    lost: float = run.zero
    for s in range(run.s):
        finer = chosen(run.used[s] * run.P[s, s], run.R[s, s], 1.0, 0.0) if s < 6 else run.zero
        spread = (1.0 - finer) * run.P[s, s]
        for r in range(s % STRIDE, 6, STRIDE):
            used = chosen(finer, 0.0, rest[s, r], run.Z[r, s])
            spread += used * used * (run.P[r, r] + run.R[r, r])
        lost += chosen(P[s, s], ROUNDING * spread, 0.0, 1.0)
        P[s, s] += chosen(EXPOSED * spread, P[s, s], FLOOR * spread, 0.0)
    return lost
