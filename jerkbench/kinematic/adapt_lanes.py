"""The adaptation of several runs at once: one that says ``lanes = True`` is compiled for vectors, like the kernel.

It is asked once for all runs that have the same rows, nearly always all of them. A run for which it finds no answer (a
matrix that is not positive definite) gets NaN, and is lost; alone it then raises its error. What an engine finds of S
itself, with a stricter test, it finds before.
"""

from jerkbench.arrays import IntArray
from jerkbench.compilation.methods import try_fill_lanes_by
from jerkbench.compilation.vectors import anywhere, chosen
from jerkbench.compilation.views import Lanes, View, lane, room, row
from jerkbench.kinematic.arguments import DENSE, STRIDE, Rules
from jerkbench.kinematic.correction import NAN


def adapt_lanes(run: Lanes, rows: IntArray, rules: Rules, complete: bool) -> None:
    """Put the adapted R of all runs in the place of what the adaptation gets, without rows of no finite variance.

    Args:
        run: the runs.
        rows: (6,) room for the numbers of the rows that are there.
        rules: the adaptation.
        complete: whether all rows of all runs are there.
    """
    for r in range(6):
        rows[r] = r
        run.variance[r] = run.zero + NAN
    run.waits = chosen(run.lost, 0.0, 0.0, 1.0)
    if complete:
        run.asks = run.waits
        _adapt_rows(run, rows, rules, 6, complete=True)
        return
    _ask_by_rows(run, rows, rules, gain=False)


def find_gains_of_lanes(run: Lanes, rows: IntArray, rules: Rules) -> None:
    """Put K' into Z, and mark the runs, if the adaptation has a gain of its own."""
    if rules.gain[0] != 0:
        clear_gains(run)
        run.waits = chosen(run.lost, 0.0, 0.0, 1.0)
        _ask_by_rows(run, rows, rules, gain=True)


def clear_gains(run: Lanes) -> None:
    """Make Z zero."""
    for r in range(6):
        for s in range(run.s):
            run.Z[r, s] = run.zero


def _ask_by_rows(run: Lanes, rows: IntArray, rules: Rules, gain: bool) -> None:
    """Ask for each set of rows by itself; a run without any is not asked."""
    for k in range(run.width):
        if lane(run, k).waits > 0.0:
            m = _find_rows(run, lane(run, k), rows)
            if m > 0:
                keeps = anywhere(chosen(run.lost, 0.0, 0.0, 1.0) - run.asks)  # whether a run does not ask now
                if keeps:
                    _keep_memory(run, rules)
                if DENSE == 1 and gain:
                    _find_gain(run, rows, rules, m)
                else:
                    _adapt_rows(run, rows, rules, m, complete=False)
                if keeps:
                    _restore_memory(run, rules)
            run.waits = chosen(run.asks, 0.0, 0.0, run.waits)


def _find_rows(run: Lanes, alone: Lanes, rows: IntArray) -> int:
    """Fill the numbers of the rows that a run has, and mark those that have the same; return how many they are."""
    m = 0
    asks = run.waits
    for r in range(6):
        there = alone.used[r]
        asks *= chosen(run.used[r], 0.5, there, 1.0 - there)
        if there > 0.0:
            rows[m] = r
            m += 1
    run.asks = asks
    return m


def _keep_memory(run: Lanes, rules: Rules) -> None:
    """Copy the memory behind itself."""
    for e in range(rules.sizes[0]):
        row(rules.memory, rules.sizes[0] + e, run, "1")[0] = row(rules.memory, e, run, "1")[0]


def _restore_memory(run: Lanes, rules: Rules) -> None:
    """Take it back from there in the runs that have not asked."""
    for e in range(rules.sizes[0]):
        memory, kept = row(rules.memory, e, run, "1"), row(rules.memory, rules.sizes[0] + e, run, "1")
        memory[0] = chosen(run.asks, 0.0, memory[0], kept[0])


def _adapt_rows(run: Lanes, rows: IntArray, rules: Rules, m: int, complete: bool) -> None:
    """Adapt R of the ``m`` rows of the runs that ask, and before it P where the adaptation does that.

    Rows that are ``complete`` have their own number: the compiler then knows where everything lies.
    """
    y, R, HPHt, adapted = room(run, "6"), room(run, "36"), room(run, "36"), room(run, "36")
    run.between = run.zero
    for i in range(m):
        r = i if complete else rows[i]
        y[i] = run.y[r]
        for j in range(m):
            R[m * i + j] = run.R[r, j if complete else rows[j]]
    well = True
    if DENSE == 1 and rules.prior[0] != 0:
        well = _adapt_prior(run, y, R, rows, rules, m, complete)
    for i in range(m):
        r = i if complete else rows[i]
        for j in range(m):
            HPHt[m * i + j] = run.P[r, j if complete else rows[j]]
    seen = rules.parameters, rules.whole, y, HPHt, R, rows, rules.memory, adapted
    well = try_fill_lanes_by(rules.adapt[0], seen, (m, rules.sizes[0])) and well
    _take(run, adapted, rows, m, complete)
    if not well:
        run.lost = run.lost + run.asks
    if STRIDE > 1:
        note_coupling(run, chosen(run.lost, 0.0, 0.0, run.asks), run.between)


def _adapt_prior(run: Lanes, y: View, R: View, rows: IntArray, rules: Rules, m: int, complete: bool) -> bool:
    """Put the adapted prior covariance into its place; return whether it raised nothing."""
    x, P, F, Q, answer = room(run, "s"), room(run, "s s"), room(run, "s s"), room(run, "s s"), room(run, "s s")
    for s in range(run.s):
        x[s] = run.x[s]
        for t in range(run.s):
            P[s, t] = run.P[s, t]
            F[s, t] = run.since_A[s // 3, t // 3] if s % 3 == t % 3 else run.zero
            Q[s, t] = run.since_Q[s // 3, t // 3] if s % 3 == t % 3 else run.zero
    seen = rules.parameters, rules.whole, x, P, F, Q, y, R, rows, rules.memory, answer
    well: bool = try_fill_lanes_by(rules.prior[0], seen, (m, rules.sizes[0], run.s))
    asks, between = (run.zero + 1.0 if complete else run.asks), run.between  # as `_take`
    for s in range(run.s):
        for t in range(s + 1):
            entry = 0.5 * (answer[s, t] + answer[t, s])
            if (s - t) % STRIDE == 0:
                run.P[s, t] = chosen(asks, 0.0, entry, run.P[s, t])
            else:
                between += entry * entry
    run.between = between
    for a in range(run.n):
        for b in range(run.n):
            same = 1.0 if a == b else 0.0
            run.since_A[a, b] = chosen(asks, 0.0, same, run.since_A[a, b])
            run.since_Q[a, b] = chosen(asks, 0.0, 0.0, run.since_Q[a, b])
    return well


def _find_gain(run: Lanes, rows: IntArray, rules: Rules, m: int) -> None:
    """Take the gain of the runs that ask."""
    x, P, y, R, K = room(run, "s"), room(run, "s s"), room(run, "6"), room(run, "36"), room(run, "s s")
    for s in range(run.s):
        x[s] = run.x[s]
        for t in range(run.s):
            P[s, t] = run.P[s, t]
    for i in range(m):
        y[i] = run.y[rows[i]]
        for j in range(m):
            R[m * i + j] = run.R[rows[i], rows[j]]
    seen = rules.parameters, rules.whole, x, P, y, R, rows, rules.memory, K
    if not try_fill_lanes_by(rules.gain[0], seen, (m, rules.sizes[0], run.s)):
        run.lost = run.lost + run.asks
    run.own = run.own + run.asks
    for i in range(m):
        for s in range(run.s):
            gain = K[(m * s + i) // run.s, (m * s + i) % run.s]
            run.Z[rows[i], s] = chosen(run.asks, 0.0, gain, run.Z[rows[i], s])


def _take(run: Lanes, adapted: View, rows: IntArray, m: int, complete: bool) -> None:
    """Take the adapted R in the runs that ask; a row without a finite variance is not used, and one of NaN is lost.

    Of ``complete`` rows all runs ask but those that are lost, in which nothing counts any more. To store in all of them
    is faster than to store in some, on processors without AVX-512.
    """
    asks, lost, between = (run.zero + 1.0 if complete else run.asks), run.lost, run.between
    for i in range(m):
        r, variance = i if complete else rows[i], adapted[(m + 1) * i]
        known = chosen(1.0, variance * 0.0, 1.0, 0.0)
        lost += asks * (1.0 - known) * chosen(variance, 0.0, 0.0, 1.0)
        run.variance[r] = chosen(asks, 0.0, variance, run.variance[r])
        run.used[r] = chosen(asks, 0.0, known, run.used[r])
        run.y[r] *= run.used[r]
    for i in range(m):
        for j in range(m):
            r, c = i if complete else rows[i], j if complete else rows[j]
            used = chosen(run.used[r] * run.used[c], 0.0, adapted[m * i + j], 0.0)
            if (r - c) % STRIDE == 0:
                run.R[r, c] = chosen(asks, 0.0, used, run.R[r, c])
            else:
                between += used * used
    run.lost, run.between = lost, between


def note_coupling(run: Lanes, asked: float, squares: float) -> None:
    """Note the runs of those ``asked`` whose adaptation put anything between two axes: ``squares``, or no number."""
    run.coupled += chosen(asked, 0.0, 1.0 - chosen(1e-300, squares, 1.0, 0.0), 0.0)
