"""The compiled measurement update: innovation, call of the adaptation, and correction."""

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.compilation.vectors import anywhere, as_numbers, in_lanes, select
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
from jerkbench.kinematic.correction import NAN, check_definite, correct, correct_by_gain, find_nis


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
