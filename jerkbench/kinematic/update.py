"""The compiled measurement update: innovation, call of the adaptation, and a correction with small rounding errors.

With W = H P, S = H P H' + R and v = S^-1 y, the update of the measured states has several equivalent forms::

    x + K y = x + W' v = x + y - R v
    posterior = P - W' S^-1 W = R - R S^-1 R = R S^-1 W

The computed factors of S are the exact factors of a matrix S + E with |E_ij| < eps sqrt(S_ii S_jj). The rounding error
of a product A' S^-1 B is therefore A' S^-1 E S^-1 B. The rounding error of the update is small if A and B are small,
and if no large number is subtracted from another large number. After a gap, P may be 1e12 R. For each state, the update
therefore starts from one of the following two pairs of value and variance, and uses the corresponding column of G::

    x + y,    R,    G = -R    if it is measured and R < P;    x,    P,    G = W    otherwise

The covariance between a state with G = -R and a state with G = W starts from 0. With S = L D L', Y = L^-1 G and w =
L^-1 y, the update adds G' S^-1 y = Y' D^-1 w to x, and subtracts G' S^-1 G = Y' D^-1 Y from P. In S, a measurement row
that is not used is a row of the identity matrix. In G and y, a measurement row that is not used is 0.
"""

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.compilation.vectors import anywhere, as_numbers, in_lanes, select
from jerkbench.kalman import EXPOSED, FLOOR, INDEFINITE, ROUNDING, SYMMETRIC
from jerkbench.kinematic.arguments import (
    DETERMINANT,
    INNOVATION,
    NIS_OF_USED,
    ROWS_USED,
    SEEN_NIS,
    SEEN_ROWS,
    VARIANCE,
    Called,
    Rules,
    Runs,
    Steps,
    read,
    read_matrix,
)

UNEQUAL = SYMMETRIC * SYMMETRIC
"""Largest accepted value of (S_ij - S_ji)^2, as a fraction of S_ii S_jj."""

NAN = float("nan")


def _fill_innovation_covariance(run: Runs, P: FloatArray) -> None:
    """Write S and y to the matrix M. Stop each run in which the asymmetry of S is too large for a rounding error."""
    M, R, used, S_diagonal, stopped = run.M, run.R, run.used, run.S_diagonal, run.stopped[0]
    for r in range(6):
        for c in range(r, 6):
            M[r, c] = used[r] * used[c] * (P[r, c] + R[r, c])
        M[r, r] += 1.0 - used[r]
        M[r, 6] = run.y[r]
        S_diagonal[r] = M[r, r]
    for r in range(6):
        for c in range(r + 1, 6):
            difference = used[r] * used[c] * (R[r, c] - R[c, r])
            limit = UNEQUAL * S_diagonal[r] * S_diagonal[c]
            stopped += select(difference * difference, limit, 1.0, 0.0)
    run.stopped[0] = stopped


def eliminate(M: FloatArray, r: int, rows: int, columns: int) -> float:
    """Subtract multiples of row ``r`` from the next rows, as in Gaussian elimination, and return 1 / M[r, r].

    If the function is called for each row in order, M = [S | B] becomes [D L' | L^-1 B] with S = L D L'. Only the upper
    triangle of S is used.
    """
    over_pivot = 1.0 / M[r, r]
    for q in range(r + 1, rows):
        factor = M[r, q] * over_pivot
        for c in range(q, columns):
            M[q, c] -= factor * M[r, c]
    return over_pivot


@not_inlined
def find_nis(run: Runs, P: FloatArray) -> float:
    """Return the NIS y' S^-1 y of each run, and compute D of S = L D L'.

    A run stops if S is not numerically symmetric and positive definite. The NIS of a stopped run is NaN.
    """
    _fill_innovation_covariance(run, P)
    M, D, stopped, total = run.M, run.D, run.stopped[0], run.y[0] * 0.0
    for r in range(6):
        stopped += select(M[r, r], ROUNDING * run.S_diagonal[r], 0.0, 1.0)
        D[r] = M[r, r]
        total += M[r, 6] * M[r, 6] * eliminate(M, r, 6, 7)
    run.stopped[0] = stopped
    return select(stopped, 0.0, NAN, total)


@not_inlined
def correct(run: Runs, x: FloatArray, P: FloatArray) -> float:
    """Update the state x and its covariance P, and return the NIS y' S^-1 y of each run.

    The NIS of a stopped run is NaN. The function replaces M = [S | y | G] by L^-1 M, row by row.
    """
    s = len(x)
    _fill_innovation_covariance(run, P)
    _fill_start(run, x, P, s)
    M, stopped, total = run.M, run.stopped[0], run.y[0] * 0.0
    doubtful = BOUND + total
    for r in range(6):
        stopped += select(M[r, r], ROUNDING * run.S_diagonal[r], 0.0, 1.0)
        run.D[r] = M[r, r]
        over_D = eliminate(M, r, 6, 7 + s)
        total += M[r, 6] * M[r, 6] * over_D
        doubtful *= run.S_diagonal[r] * over_D
        for a in range(s):
            factor = M[r, 7 + a] * over_D
            x[a] += factor * M[r, 6]
            for b in range(a + 1):
                P[a, b] -= factor * M[r, 7 + b]
    run.stopped[0] = stopped
    doubt = total * 0.0
    for a in range(s):
        doubt += select(P[a, a], doubtful * run.before[a], 0.0, 1.0)
        for b in range(a):
            P[b, a] = P[a, b]
    if anywhere(select(stopped, 0.0, 0.0, doubt)):
        _widen(run, P, s)
    return select(stopped, 0.0, NAN, total)


def _fill_start(run: Runs, x: FloatArray, P: FloatArray, s: int) -> None:
    """Write G to M, and replace x and P by the values from which the update starts.

    The docstring of this module describes G and these values.
    """
    R, M, used, fine, before, some = run.R, run.M, run.used, run.fine, run.before, run.y[0] * 0.0
    for r in range(6):
        fine[r] = select(used[r] * P[r, r], R[r, r], 1.0, 0.0)
        before[r] = select(fine[r], 0.0, R[r, r], P[r, r])
        some += fine[r]
    for a in range(6, s):
        before[a] = P[a, a]
    for r in range(6):
        for a in range(s):
            M[r, 7 + a] = P[r, a] * used[r]
    if anywhere(some):
        for r in range(6):
            for a in range(6):
                M[r, 7 + a] = select(fine[a], 0.0, 0.0 - R[a, r], M[r, 7 + a])
        for a in range(6):
            x[a] += fine[a] * run.y[a]
            for b in range(a + 1):
                P[a, b] = (1.0 - fine[a]) * (1.0 - fine[b]) * P[a, b] + fine[a] * fine[b] * R[a, b]
        for a in range(6, s):
            for b in range(6):
                P[a, b] *= 1.0 - fine[b]


BOUND = 4.0 * EXPOSED
"""A limit for skipping `_widen`, larger than (1 + e) EXPOSED.

Let C be the correlation matrix of S. If the posterior variance is larger than BOUND / det C times the variance from
which the update started, `_widen` does not change the posterior variance. With Z = S^-1 G, m rows and the smallest
eigenvalue of C:

    sum_i Z_i^2 S_ii <= Z' S Z / eigenvalue(C),    eigenvalue(C) >= det C ((m - 1) / m)^(m - 1) > det C / e

The second inequality holds because the mean of the other eigenvalues of C is at most m / (m - 1).
"""


def solve_back(M: FloatArray, Z: FloatArray, first: int, columns: int) -> None:
    """Compute Z = L'^-1 D^-1 Y, where M = [D L' | ... | Y ...] contains Y in the columns from ``first`` on."""
    for c in range(columns):
        for r in range(5, -1, -1):
            rest = M[r, first + c]
            for j in range(r + 1, 6):
                rest -= M[r, j] * Z[j, c]
            Z[r, c] = rest / M[r, r]


@not_inlined
def _widen(run: Runs, P: FloatArray, s: int) -> None:
    """Increase each variance that is small compared with its rounding error (`jerkbench.kalman.rounding_noise`).

    A run stops if one of its variances consists only of rounding errors (`jerkbench.kalman.ROUNDING`).
    """
    stopped, Z = run.stopped[0], run.gain
    solve_back(run.M, Z, 7, s)
    for a in range(s):
        variance, spread = P[a, a], run.before[a]
        if a < 6:
            spread *= 1.0 - run.fine[a]
        for r in range(6):
            spread += Z[r, a] * Z[r, a] * run.S_diagonal[r]
        stopped += select(variance, ROUNDING * spread, 0.0, 1.0)
        P[a, a] = variance + select(EXPOSED * spread, variance, FLOOR * spread, 0.0)
    run.stopped[0] = stopped


@not_inlined
def check_definite(run: Runs, x: FloatArray, P: FloatArray) -> None:
    """Stop each run whose covariance is not positive definite up to rounding, or whose state is not finite."""
    C, stopped, s = run.square, run.stopped[0], len(x)
    for a in range(s):
        stopped += select(1.0, x[a] * 0.0, 0.0, 1.0)
        for b in range(a, s):
            C[a, b] = P[a, b]
        C[a, a] *= 1.0 + INDEFINITE
    for c in range(s):
        stopped += select(C[c, c], 0.0, 0.0, 1.0)
        eliminate(C, c, s, s)
    run.stopped[0] = stopped


@not_inlined
def correct_by_gain(run: Runs, s: int) -> float:
    """Update the state with the gain K of the adaptation, and return the NIS y' S^-1 y of each run.

    The covariance update is P = (I - K H) P (I - K H)' + K R K', where K is the transpose of ``run.gain``. I - K H is
    computed before the products with P, so that for K = 1 the result does not contain a rounding error of P, which may
    be 1e16 R after a gap. For states that are not measured, the columns of I - K H are columns of the identity matrix,
    so the multiplication with these columns is omitted.
    """
    x, P, R, K, rest, half, used = run.x, run.P, run.R, run.gain, run.M, run.square, run.used
    distance = find_nis(run, P)
    for a in range(s):
        for r in range(6):  # transposed columns of I - K H for the measured states
            rest[r, a] = (used[r] if r == a else 0.0) - K[r, a]
        for b in range(s):
            half[a, b] = P[a, b] * (1.0 - used[a] if a < 6 else 1.0)
        for r in range(6):
            for b in range(s):
                half[a, b] += rest[r, a] * P[r, b]
    for a in range(s):
        for r in range(6):
            x[a] += K[r, a] * run.y[r]
    _note_spread(run, s)
    KR = run.D
    for a in range(s):
        for r in range(6):
            KR[r] = K[0, a] * R[0, r]
            for c in range(1, 6):
                KR[r] += K[c, a] * R[c, r]
        for b in range(s):
            P[a, b] = half[a, b] * (1.0 - used[b] if b < 6 else 1.0)
            for r in range(6):
                P[a, b] += half[a, r] * rest[r, b] + KR[r] * K[r, b]
    stopped = run.stopped[0]
    for a in range(s):
        for b in range(a):
            P[a, b] = P[b, a] = 0.5 * (P[a, b] + P[b, a])
        spread = run.before[a]
        stopped += select(P[a, a], ROUNDING * spread, 0.0, 1.0)
        P[a, a] += select(EXPOSED * spread, P[a, a], FLOOR * spread, 0.0)
    run.stopped[0] = stopped
    return distance


def _note_spread(run: Runs, s: int) -> None:
    """Compute the spread of the posterior variances (`jerkbench.kalman.spread_by`) and write it to ``before``."""
    P, R, K, rest = run.P, run.R, run.gain, run.M
    for a in range(s):
        finer = select(run.used[a] * P[a, a], R[a, a], 1.0, 0.0) if a < 6 else 0.0 * P[a, a]
        spread = (1.0 - finer) * P[a, a]
        for r in range(6):
            part = select(finer, 0.0, rest[r, a], K[r, a])
            spread += part * part * (P[r, r] + R[r, r])
        run.before[a] = spread


# Innovation and adaptation.


def fill_innovation(run: Runs, z: FloatArray, which: int) -> None:
    """Compute the innovation y = z - H x for row ``which`` of z, and mark the measured rows in ``used``."""
    y, used = run.y, run.used
    read(z, which, y)
    for r in range(6):
        used[r] = select(1.0, y[r] * 0.0, 1.0, 0.0)
        y[r] = select(used[r], 0.0, y[r] - run.x[r], 0.0)


def update(run: Runs, steps: Steps, rules: Rules, adapt: Called, gain: Called, which: int) -> None:
    """Update the state and its covariance with the adapted R, or with the gain of the adaptation.

    Args:
        run: record of the runs with the innovation that `fill_innovation` has computed.
        steps: measurements of the runs.
        rules: parameters and memory of the adaptations.
        adapt: compiled function that adapts R.
        gain: compiled function that computes the Kalman gain, which is called if ``rules.has_gain`` is true.
        which: row of ``steps.z`` and ``steps.R`` that contains the measurements.
    """
    expect(run, steps, which)
    if rules.called:
        adapt_R(run, rules, adapt)
    if rules.has_gain:
        _find_gains(run, rules, gain)
        note_used(run, correct_by_gain(run, len(run.x)))
    else:
        note_used(run, correct(run, run.x, run.P))
    check_definite(run, run.x, run.P)


@not_inlined
def expect(run: Runs, steps: Steps, which: int) -> None:
    """Store the innovation and its NIS with the reported R times ``steps.scale``, and the R for the adaptation."""
    R, used, scale, seen, D = run.R, run.used, in_lanes(steps.scale), run.seen, run.D
    _read_covariance(run, steps.R, which)
    for block in range(2):
        for r in range(3 * block, 3 * block + 3):
            for c in range(3 * block, 3 * block + 3):
                R[r, c] *= scale[block]
            smallest = scale[2] * used[r]
            R[r, r] = select(smallest, R[r, r], smallest, R[r, r])
    seen[SEEN_ROWS], seen[SEEN_NIS] = rows_used(run), find_nis(run, run.P)
    seen[DETERMINANT] = D[0] * D[1] * D[2] * D[3] * D[4] * D[5]
    if len(steps.R_true) > 0:
        _read_covariance(run, steps.R_true, which)
    for r in range(6):
        seen[INNOVATION + r] = select(used[r], 0.0, run.y[r], NAN)
        seen[VARIANCE + r] = select(used[r], 0.0, R[r, r], NAN)


@not_inlined
def _read_covariance(run: Runs, stream: FloatArray, which: int) -> None:
    """Read R from a row of a stream, and set the rows and columns of unmeasured components to 0."""
    R, used = run.R, run.used
    read_matrix(stream, which, R)
    if not anywhere(6.0 - rows_used(run)):
        return
    for r in range(6):
        for c in range(6):
            R[r, c] = select(used[r] * used[c], 0.0, R[r, c], 0.0)


def rows_used(run: Runs) -> float:
    """Return the number of measurement rows that are used in each run."""
    used = run.used
    return used[0] + used[1] + used[2] + used[3] + used[4] + used[5]


def note_used(run: Runs, nis: float) -> None:
    """Store the number of measurement rows that the adaptation has not dropped, and the NIS of these rows."""
    run.seen[ROWS_USED] = rows_used(run)
    run.seen[NIS_OF_USED] = select(run.seen[ROWS_USED], 0.0, nis, NAN)


@not_inlined
def adapt_R(run: Runs, rules: Rules, adapt: Called) -> None:
    """Compute the adapted R of each run, and drop measurement rows with an infinite variance.

    A run fails and stops if the adaptation raises an error or returns NaN.
    """
    adapted, failed, used = run.adapted, run.failed, run.used
    _call_for_groups(run, rules, adapt, adapted)
    well = select(run.stopped[0], 0.0, 0.0, 1.0)
    for r in range(6):
        variance = select(used[r], 0.0, adapted[r, r], NAN)
        finite = select(1.0, variance * 0.0, 1.0, 0.0)
        unknown = used[r] * (1.0 - finite) * select(variance, 0.0, 0.0, 1.0)
        failed[0] += select(well * unknown, 0.0, 1.0, 0.0)
        run.seen[VARIANCE + r] = variance
        used[r] *= finite
        run.y[r] = select(used[r], 0.0, run.y[r], 0.0)
    for r in range(6):
        for c in range(6):
            run.R[r, c] = select(used[r] * used[c], 0.0, adapted[r, c], 0.0)
    run.stopped[0] += select(failed[0], 0.0, 1.0, 0.0)


def _find_gains(run: Runs, rules: Rules, gain: Called) -> None:
    """Compute the transposed gain K' of all runs, with 0 in the measurement rows that are not used."""
    for r in range(6):
        for a in range(len(run.x)):
            run.gain[r, a] = 0.0
    _call_for_groups(run, rules, gain, run.gain)
    run.stopped[0] += select(run.failed[0], 0.0, 1.0, 0.0)


@not_inlined
def _call_for_groups(run: Runs, rules: Rules, function: Called, result: FloatArray) -> None:
    """Call an adaptation, or its gain, separately for each group of runs with the same measured rows."""
    waiting, selected, rows = as_numbers(run.waiting), as_numbers(run.selected), rules.rows
    x, P, A, Q = as_numbers(run.x), as_numbers(run.P), as_numbers(run.A), as_numbers(run.Q)
    y, R, found, failed = as_numbers(run.y), as_numbers(run.R), as_numbers(result), as_numbers(run.failed)
    run.waiting[0] = select(run.stopped[0], 0.0, 0.0, 1.0)
    for k in range(8):
        if waiting[0, k] > 0.0:
            m = _select_group(run, rows, k)
            if m > 0:
                function(rules.parameters, selected, x, P, A, Q, y, R, rows[:m], rules.memory, found, failed)


def _select_group(run: Runs, rows: IntArray, k: int) -> int:
    """Select all waiting runs with the same measured rows as run ``k``, and write these rows to ``rows``.

    A run is waiting if the adaptation has not been called for this run yet. The function returns the number of measured
    rows.
    """
    used, selected, m = as_numbers(run.used), run.waiting[0], 0
    for r in range(6):
        difference = run.used[r] - used[r, k]
        selected *= 1.0 - difference * difference
        if used[r, k] > 0.0:
            rows[m] = r
            m += 1
    run.selected[0] = selected
    run.waiting[0] -= selected
    return m
