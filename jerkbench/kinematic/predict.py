"""Prediction with F = A (x) I3: the same product for each pair of axes, of which half of the covariance is enough."""

from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Lanes, View, eights, room, taken, wide_room
from jerkbench.kinematic.arguments import DENSE, STRIDE, Model, Steps

AxisViews = tuple[View, View, View]
"""A, b and Q of one axis, for one length of a step: numbers, or vectors where each run has its own."""


ANY, TRIANGULAR, AT_UPDATES = range(3)
"""How to predict: with any A, with one that is upper triangular with ones on its diagonal, or likewise the state alone.

Of the covariance then A and Q of all steps since the last update are one step: `join_steps` makes it,
`predict_usual` or `predict_covariance` takes it. A score that reads the covariance at each step has its own,
`run.P_scored`.
"""


def predict(run: Lanes, model: AxisViews, how: int, u: View) -> None:
    """Make x = F x + B u and P = F P F' + Q (x) I3, or AT_UPDATES the P of the score; ``how`` as above."""
    A, b, Q = room(run, "n n"), room(run, "n"), room(run, "n n")  # copies: the compiler knows that nothing overlaps
    for a in range(run.n):
        b[a] = model[1][a]
        for c in range(run.n):
            A[a, c], Q[a, c] = model[0][a, c], model[2][a, c]
    if how == ANY:
        predict_any(run, A, b, Q, u)
        return
    predict_state(run, run.x, A, b, u)
    if run.width == 1:
        _predict_pairs(run, A, Q)
    elif how == AT_UPDATES:
        _predict_every_pair(run, run.P_scored, A, Q)
    else:
        _predict_every_pair(run, run.P, A, Q)


def predict_state(run: Lanes, x: View, A: View, b: View, u: View) -> None:
    """Make x = A x + b u on each axis; A is upper triangular with ones on its diagonal."""
    for i in range(3):
        for a in range(run.n):
            moved = x[3 * a + i] + b[a] * u[i]
            for c in range(a + 1, run.n):
                moved += A[a, c] * x[3 * c + i]
            x[3 * a + i] = moved


def _join(run: Lanes, A: View, Q: View) -> None:
    """Take the transition since P was predicted, and its noise, on over a step: A gone_A, A gone_Q A' + Q."""
    M = room(run, "n n")
    for a in range(run.n):
        for b in range(a, run.n):
            M[a, b] = run.gone_Q[a, b]
            for c in range(a + 1, b + 1):
                run.gone_A[a, b] += A[a, c] * run.gone_A[c, b]
    transform(M, A, run.n, 1)
    for a in range(run.n):
        for b in range(a, run.n):
            run.gone_Q[a, b] = run.gone_Q[b, a] = M[a, b] + Q[a, b]


def join_steps(run: Lanes, model: Model, steps: Steps, begin: int, end: int, known: bool, fresh: bool) -> None:
    """Join steps ``begin`` to ``end`` (not included) to what is joined already.

    Args:
        run: the runs.
        model: the filter.
        steps: the steps.
        begin: the first of them.
        end: the step behind the last.
        known: whether they are ``usual_A`` and ``usual_Q``.
        fresh: whether nothing is joined already; then these are usual from now on.
    """
    for step in range(begin, begin if known else end):
        k = steps.model[step]
        if k >= 0:
            _join(run, taken(model.A, k, run, "n n"), taken(model.Q, k, run, "n n"))
    for a in range(run.n):
        for b in range(run.n):
            if known:
                run.gone_A[a, b], run.gone_Q[a, b] = run.usual_A[a, b], run.usual_Q[a, b]
            elif fresh:
                run.usual_A[a, b], run.usual_Q[a, b] = run.gone_A[a, b], run.gone_Q[a, b]


def predict_usual(run: Lanes) -> None:
    """Take P over as many steps as usual."""
    A, Q = room(run, "n n"), room(run, "n n")
    for a in range(run.n):
        for b in range(a, run.n):
            A[a, b], Q[a, b] = run.usual_A[a, b], run.usual_Q[a, b]
    _predict_every_pair(run, run.P, A, Q)


def predict_covariance(run: Lanes) -> None:
    """Take P over all steps since it was predicted, at once, of the runs in which an update is ``due``.

    The others go over no step at all, so that no run depends on the updates of its neighbours. Likewise the transition
    since the last update, where a rule is shown it.
    """
    A, Q, due = room(run, "n n"), room(run, "n n"), run.due
    for a in range(run.n):
        for b in range(run.n):
            same = run.zero + (1.0 if a == b else 0.0)
            A[a, b], Q[a, b] = chosen(due, 0.0, run.gone_A[a, b], same), chosen(due, 0.0, run.gone_Q[a, b], 0.0)
            run.gone_A[a, b] = chosen(due, 0.0, same, run.gone_A[a, b])
            run.gone_Q[a, b] = chosen(due, 0.0, 0.0, run.gone_Q[a, b])
    _predict_every_pair(run, run.P, A, Q)
    if DENSE == 1:
        _advance_step(run, A, Q)


def show_covariance(run: Lanes, due: float) -> None:
    """Let the score go on from P in the runs that had an update ``due``."""
    for s in range(run.s):
        for t in range(s, run.s):
            run.P_scored[s, t] = chosen(due, 0.0, run.P[s, t], run.P_scored[s, t])


def no_time(run: Lanes, A: View, Q: View) -> None:
    """Make of A and Q those of no time at all: the identity, and nothing."""
    for a in range(run.n):
        for b in range(run.n):
            A[a, b], Q[a, b] = run.zero + (1.0 if a == b else 0.0), run.zero


def _predict_pairs(run: Lanes, A: View, Q: View) -> None:
    """All pairs of axes of one run at once: a tenth faster than one after the other."""
    M = wide_room(run, "n n")
    for a in range(run.n):
        for c in range(run.n):
            M[a, c] = run.pairs[a, c]
    transform(M, A, run.n, 0)
    for a in range(run.n):
        for c in range(run.n):
            run.pairs[a, c] = M[a, c] + run.same * Q[a, c]


def _predict_every_pair(run: Lanes, P: View, A: View, Q: View) -> None:
    for i in range(3):
        for j in range(i, 3, STRIDE):
            _predict_pair(run, P, A, Q, i, j)


def _predict_pair(run: Lanes, P: View, A: View, Q: View, i: int, j: int) -> None:
    """The covariance of two axes; of equal ones the upper triangle."""
    M = room(run, "n n")
    for a in range(run.n):
        for c in range(a if i == j else 0, run.n):
            M[a, c] = P[3 * a + i, 3 * c + j]
    transform(M, A, run.n, 1 if i == j else 0)
    for a in range(run.n):
        for c in range(a if i == j else 0, run.n):
            P[3 * a + i, 3 * c + j] = M[a, c] + Q[a, c] if i == j else M[a, c]


def transform(M: View, A: View, n: int, half: int) -> None:
    """M = A M A': rows from above, then columns from the left; ``half``: of a symmetric M the upper triangle."""
    for a in range(n):
        for b in range(a if half else 0, n):
            for c in range(a + 1, n):
                M[a, b] += A[a, c] * (M[min(b, c), max(b, c)] if half else M[c, b])
    for a in range(n):
        for b in range(a if half else 0, n):
            for d in range(b + 1, n):
                M[a, b] += A[b, d] * M[a, d]


def predict_any(run: Lanes, A: View, b: View, Q: View, u: View) -> None:
    """The same for any A."""
    old = room(run, "n")
    for i in range(3):
        for a in range(run.n):
            old[a] = run.x[3 * a + i]
        for a in range(run.n):
            run.x[3 * a + i] = b[a] * u[i]
            for c in range(run.n):
                run.x[3 * a + i] += A[a, c] * old[c]
        for j in range(i, 3, STRIDE):
            _predict_any_pair(run, A, Q, i, j)


def _predict_any_pair(run: Lanes, A: View, Q: View, i: int, j: int) -> None:
    AP = room(run, "n n")
    for a in range(run.n):
        for c in range(run.n):
            AP[a, c] = A[a, 0] * run.P[i, 3 * c + j]
            for d in range(1, run.n):
                AP[a, c] += A[a, d] * run.P[3 * d + i, 3 * c + j]
    for a in range(run.n):
        for c in range(run.n):
            total = Q[a, c] if i == j else run.zero
            for d in range(run.n):
                total += A[c, d] * AP[a, d]
            run.P[3 * a + i, 3 * c + j] = total


def mirror(run: Lanes) -> None:
    """Fill the other half of the covariance of an axis with itself, where all pairs are predicted alike."""
    if run.width == 1:
        for i in range(3):
            for a in range(1, run.n):
                for b in range(a):
                    run.block[i * (7 - i) // 2, a, b] = run.block[i * (7 - i) // 2, b, a]


def mark_axes(run: Lanes) -> None:
    """Note which pairs of axes are one axis with itself, likewise."""
    if run.width == 1:
        marks = room(run, "8")
        for p in range(8):
            marks[p] = 1.0 if p in (0, 3, 5) else 0.0
        run.same = eights(marks)[0]


# The transition since the last update, which an adaptation of the prior is shown.


def advance(run: Lanes, model: Model, steps: Steps, begin: int, end: int) -> None:
    """Take the transition of each run on over steps ``begin`` to ``end`` (not included)."""
    for step in range(begin, end):
        k = steps.model[step]
        if k >= 0:
            _advance_step(run, taken(model.A, k, run, "n n"), taken(model.Q, k, run, "n n"))


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
