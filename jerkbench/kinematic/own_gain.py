"""The update of a run whose adaptation has a gain of its own, in whole matrices."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import fill_by, try_fill_by
from jerkbench.compilation.methods import Method
from jerkbench.compilation.vector_ops import scratch
from jerkbench.kalman import EXPOSED, FLOOR, ROUNDING
from jerkbench.kinematic.arguments import Packed, Rules, Runs, Whole
from jerkbench.kinematic.exchange import packed_of
from jerkbench.kinematic.layout import KEPT, LOST, SQUARED, WIDTH, R, S, X, Y
from jerkbench.kinematic.prior import MEASURED, STATE, put_covariance, take_whole, whole_of

GAIN = Method("adapt_gain", (*STATE[:2], *MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, m)")


def find_gains(numbers: FloatArray, runs: Runs, rules: Rules) -> None:
    """Work out the update of the runs that have a gain of their own, from the prior and the adapted R."""
    packed, whole = packed_of(runs), whole_of(runs)
    for run in range(WIDTH):
        runs.own[run, 0] = 0.0
        if rules.gain[run] == 0 or numbers[LOST * WIDTH + run] > 0.0:
            continue
        m = _take_kept(numbers, run, packed)
        if m > 0:
            take_whole(numbers, run, whole)
            well = call_gain(rules, run, whole, packed, m)
            runs.own[run, 0], runs.own[run, 1] = 1.0, 0.0 if well else 1.0
            _own_update(runs.own[run], whole, packed, m)


def call_gain(rules: Rules, run: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the gain of a run; return whether `adapt_gain` raised no error."""
    seen = rules.parameters[run], whole.x, whole.P, packed.y, packed.R, packed.rows, rules.memory[run], whole.answer
    if WIDTH > 1:
        well: bool = try_fill_by(rules.gain[run], seen, (m, rules.sizes[run], S))
        return well
    fill_by(rules.gain[run], seen, (m, rules.sizes[run], S))
    return True


def _take_kept(numbers: FloatArray, run: int, packed: Packed) -> int:
    """Fill rows, innovation and adapted R of the rows that are used; return how many they are."""
    m = 0
    for r in range(6):
        if numbers[(KEPT + r) * WIDTH + run] > 0.0:
            packed.rows[m], packed.y[m] = r, numbers[(Y + r) * WIDTH + run]
            m += 1
    for i in range(m):
        for j in range(m):
            packed.R[m * i + j] = numbers[(R + 6 * packed.rows[i] + packed.rows[j]) * WIDTH + run]
    return m


def _own_update(own: FloatArray, whole: Whole, packed: Packed, m: int) -> None:
    """Put x + K y, and (I - K H) P (I - K H)' + K R K', into ``own``; K is the answer of the adaptation.

    I - K H is worked out first, and its rows and columns of states that are not measured are taken as they are: P may
    be 1e16 R after a gap, and where K is one nothing of P may be left. `put_covariance` makes the result symmetric.
    """
    rest, restP, noise = scratch(SQUARED, 1), scratch(SQUARED, 1), scratch(6, 1)
    free, K = scratch(S, 1), whole.answer
    _fill_rest(rest, free, K, packed, m)
    for s in range(S):
        own[2 + s] = whole.x[s]
        for i in range(m):
            own[2 + s] += K[m * s + i] * packed.y[i]
        for t in range(S):
            restP[S * s + t] = free[s] * whole.P[S * s + t]
            for i in range(m):
                restP[S * s + t] += rest[6 * s + i] * whole.P[S * packed.rows[i] + t]
    for s in range(S):
        for i in range(m):
            noise[i] = _noise(K, packed.R, m, s, i)
        for t in range(S):
            total = free[t] * restP[S * s + t]
            for i in range(m):
                total += restP[S * s + packed.rows[i]] * rest[6 * t + i] + noise[i] * K[m * t + i]
            own[2 + S + S * s + t] = total
    _note_rounding(own, rest, whole, packed, m)


def _fill_rest(rest: FloatArray, free: FloatArray, K: FloatArray, packed: Packed, m: int) -> None:
    """Fill the measured columns of I - K H, and 1 for each state that is not measured, else 0."""
    for s in range(S):
        free[s] = 1.0
        for i in range(m):
            measured = 1.0 if packed.rows[i] == s else 0.0
            free[s] -= measured
            rest[6 * s + i] = measured - K[m * s + i]


def _noise(K: FloatArray, R: FloatArray, m: int, s: int, i: int) -> float:
    """K R of a state and a row."""
    total = 0.0
    for j in range(m):
        total += K[m * s + j] * R[m * j + i]
    return total


def _note_rounding(own: FloatArray, rest: FloatArray, whole: Whole, packed: Packed, m: int) -> None:
    """Add rounding to the variances, and raise LOST where they are nothing else (`jerkbench.kalman.spread_by`)."""
    for s in range(S):
        finer, spread = 0.0, 0.0
        for i in range(m):
            if packed.rows[i] == s and packed.R[(m + 1) * i] < whole.P[(S + 1) * s]:
                finer = 1.0
        for i in range(m):
            used = rest[6 * s + i] if finer > 0.0 else whole.answer[m * s + i]
            spread += used * used * (whole.P[(S + 1) * packed.rows[i]] + packed.R[(m + 1) * i])
        spread += (1.0 - finer) * whole.P[(S + 1) * s]
        variance = own[2 + S + (S + 1) * s]
        if not variance > ROUNDING * spread:
            own[1] += 1.0
        if variance < EXPOSED * spread:
            own[2 + S + (S + 1) * s] += FLOOR * spread


def put_gains(numbers: FloatArray, runs: Runs) -> None:
    """Put these updates into the place of those that the runs would have had."""
    for run in range(WIDTH):
        if runs.own[run, 0] > 0.0:
            numbers[LOST * WIDTH + run] = runs.own[run, 1]
            for s in range(S):
                numbers[(X + s) * WIDTH + run] = runs.own[run, 2 + s]
            put_covariance(numbers, run, runs.own[run, 2 + S :])
