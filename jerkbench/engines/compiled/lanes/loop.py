"""WIDTH runs: the steps of their common timeline, one after the other."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import WIDTH, chosen, vectors
from jerkbench.engines.compiled.arguments import Adapt, Fade, Packed, Rule
from jerkbench.engines.compiled.gain import mahalanobis
from jerkbench.engines.compiled.lanes.adapt import adapt_lane
from jerkbench.engines.compiled.lanes.places import NIS, NIS_USED, OUTAGE, SQUARE, UPDATES, UPDATES_USED
from jerkbench.engines.compiled.lanes.predict import pairs_to_square, predict, square_to_pairs
from jerkbench.engines.compiled.lanes.score import score
from jerkbench.engines.compiled.lanes.update import check_definite, correct
from jerkbench.engines.compiled.places import KEPT, ROW, P, R, X, Y


class LaneSteps(NamedTuple):
    """The steps that the runs share, and in vectors (a last axis of WIDTH) what they do not.

    Attributes:
        model: (n,) row of A, b, Q, or -1.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of truth, or -1.
        mark: (k,) row of the errors that are kept, or -1.
        u: (samples, 3, WIDTH).
        z: (m, 6, WIDTH), 0 where there is none.
        kept: (m, 6, WIDTH) 1 where a row is there, else 0.
        R: (m, 21, WIDTH) lower triangle of what the adaptation gets.
        reported: (m, 21, WIDTH) lower triangle of what the receiver reported.
        late: (m, WIDTH) 1 where an update counts, else 0.
        truth: (k, 6, WIDTH).
        weights: (k, 4) in the order of `places.ROWS`.
        outage: (k, WIDTH) 1 where a row counts for the outages, else 0; or no row where there are none.
        x0: (6, WIDTH).
        P0: (36, WIDTH).
    """

    model: IntArray
    sample: IntArray
    update: IntArray
    reference: IntArray
    mark: IntArray
    u: FloatArray
    z: FloatArray
    kept: FloatArray
    R: FloatArray
    reported: FloatArray
    late: FloatArray
    truth: FloatArray
    weights: FloatArray
    outage: FloatArray
    x0: FloatArray
    P0: FloatArray


class LaneModel(NamedTuple):
    """The filter: A (k, N, N), b (k, N), Q (k, N, N), and the initial variances (N - 2,) of the other states."""

    A: FloatArray
    b: FloatArray
    Q: FloatArray
    extra: FloatArray


class LaneKept(NamedTuple):
    """Room for what the runs leave.

    Attributes:
        w: the array in which the runs live; its end holds the sums.
        memory: (WIDTH, size) what the adaptation remembers, zero.
        errors: (marks, 3, WIDTH) position errors at the marked rows.
        seen: (m, SEEN, WIDTH) what each update saw: rows, nis, rows kept, nis used, innovation (6), diagonal of R (6);
            or one row, which each update writes anew.
        room: (114,) for what an adaptation sees.
        rows: (6,) the same.
    """

    w: FloatArray
    memory: FloatArray
    errors: FloatArray
    seen: FloatArray
    room: FloatArray
    rows: IntArray


SEEN = 16


def run_lanes(
    adapt: Adapt, fade: Fade, steps: LaneSteps, model: LaneModel, parameters: FloatArray, fades: bool, kept: LaneKept
) -> None:
    """Run all steps; what comes out lies in ``kept``."""
    w, u, errors = vectors(kept.w), vectors(steps.u), vectors(kept.errors)
    truth, outage = vectors(steps.truth), vectors(steps.outage)
    numbers = steps.R.reshape(-1)
    HPHt, given, adapted = kept.room[:36], kept.room[36:72], kept.room[72:108]
    of_six = HPHt.reshape(6, 6), given.reshape(6, 6), adapted.reshape(6, 6)
    packed = Packed(kept.rows, kept.room[108:114], HPHt, given, adapted, *of_six)
    start(w, vectors(steps.x0), vectors(steps.P0), model.extra)
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            predict(w, model.A, model.b, model.Q, steps.model[k], u, steps.sample[k])
        which = steps.update[k]
        if which >= 0:
            measure(w, vectors(steps.z), vectors(steps.kept), vectors(steps.reported), which)
            at = which if len(kept.seen) > 1 else 0
            notice(w, vectors(kept.seen), at)
            for lane in range(WIDTH):
                rule = Rule(parameters, kept.memory[lane], fades)
                adapt_lane(adapt, fade, kept.w, lane, packed, numbers, 21 * WIDTH * which, rule, kept.seen[at])
            finish(w, vectors(kept.seen), at, vectors(steps.late)[which])
        row = steps.reference[k]
        if row >= 0:
            if steps.mark[row] >= 0:
                for i in range(3):
                    errors[3 * steps.mark[row] + i] = w[X + i] - truth[6 * row + i]
            score(w, truth, row, steps.weights)
            if len(steps.outage):
                w[OUTAGE] += outage[row] * w[SQUARE]


def start(w: FloatArray, x0: FloatArray, P0: FloatArray, extra: FloatArray) -> None:
    """Put the initial state and covariance into w, which is zero."""
    for s in range(6):
        w[X + s] = x0[s]
        for t in range(6):
            w[P + ROW * s + t] = P0[6 * s + t]
    for a in range(len(extra)):
        for i in range(3):
            w[P + (ROW + 1) * (6 + 3 * a + i)] = w[X] * 0.0 + extra[a]
    square_to_pairs(w)


def measure(w: FloatArray, z: FloatArray, kept: FloatArray, reported: FloatArray, which: int) -> None:
    """Take row ``which`` of the measurements: innovation, and R as the receiver reported it."""
    pairs_to_square(w)
    for r in range(6):
        w[KEPT + r] = kept[6 * which + r]
        w[Y + r] = (z[6 * which + r] - w[X + r]) * w[KEPT + r]
    e = 21 * which
    for r in range(6):
        for c in range(r + 1):
            w[R + 6 * r + c] = reported[e]
            w[R + 6 * c + r] = reported[e]
            e += 1


def notice(w: FloatArray, seen: FloatArray, row: int) -> None:
    """Keep what the receiver's R makes of the innovation in row ``row`` of ``seen``."""
    rows = w[KEPT]
    for r in range(1, 6):
        rows += w[KEPT + r]
    seen[SEEN * row] = rows
    seen[SEEN * row + 1] = mahalanobis(w)
    for r in range(6):
        seen[SEEN * row + 4 + r] = w[Y + r]


def finish(w: FloatArray, seen: FloatArray, row: int, counts: float) -> None:
    """Update with the adapted R, and count it where ``counts`` is 1."""
    at = SEEN * row
    seen[at + 3] = correct(w)
    check_definite(w)
    square_to_pairs(w)
    for total, number, j in ((NIS, UPDATES, 0), (NIS_USED, UPDATES_USED, 2)):
        w[total] += chosen(seen[at + j], 0.0, counts * seen[at + j + 1] / seen[at + j], 0.0)
        w[number] += chosen(seen[at + j], 0.0, counts, 0.0)
