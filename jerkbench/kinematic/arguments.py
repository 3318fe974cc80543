"""Arguments of the compiled loop: what it is given, and what it fills. WIDTH is the number of runs side by side."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatCube, FloatMatrix, FloatVector, IntVector
from jerkbench.compilation.vectors import aligned_zeros

SIX, MATRIX = 8, 40
"""Six numbers, and 36, with room up to the next whole eight."""

SEEN = 17
"""Numbers that are kept of what an update saw."""

MARKED = 9
"""Numbers that are kept of a marked row: the position error (3), and the upper triangle of its covariance (6)."""


class Steps(NamedTuple):
    """The steps that the runs share, and in vectors (a last axis of WIDTH) what they do not.

    Attributes:
        model: (n,) row of A, b, Q, or -1: no time passes.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of the reference, or -1.
        u: (samples, 3, WIDTH).
        z: (m, 6, WIDTH) measurements, NaN where there is none.
        R: (m, 36, WIDTH) what the adaptation gets; or no row where that is what was reported.
        reported: (m, 36, WIDTH) what the receiver reported.
        x0: (6, WIDTH) position and velocity at the start.
        P0: (36, WIDTH) their covariance.
    """

    model: IntVector
    sample: IntVector
    update: IntVector
    reference: IntVector
    u: FloatCube
    z: FloatCube
    R: FloatCube
    reported: FloatCube
    x0: FloatMatrix
    P0: FloatMatrix


class Score(NamedTuple):
    """What the k visited rows of the reference count for; nothing is scored where there are none.

    Attributes:
        mark: (k,) row of the errors that are kept, or -1.
        counts: (m, WIDTH) 1 where an update counts, else 0.
        truth: (k, 6, WIDTH).
        weights: (k, 4) in the order of `layout.WEIGHTS`.
        outage: (k, WIDTH) 1 where a row counts for the outages, else 0; or no row where there are none.
    """

    mark: IntVector
    counts: FloatMatrix
    truth: FloatCube
    weights: FloatMatrix
    outage: FloatMatrix


class Model(NamedTuple):
    """The filter of each run; an axis L is WIDTH, or 1 where they have the same.

    Attributes:
        A: (k, N N, L) of one axis, for each length of a step.
        b: (k, N, L) likewise.
        Q: (k, N N, L) likewise.
        extra: (N - 2, WIDTH) initial variances of the states that are not measured.
        triangular: whether every A is upper triangular with ones on its diagonal.
    """

    A: FloatCube
    b: FloatCube
    Q: FloatCube
    extra: FloatMatrix
    triangular: bool


class Rules(NamedTuple):
    """The adaptation of each run.

    Attributes:
        parameters: (WIDTH, any) its numbers.
        adapt: (WIDTH,) address of its `adapt`, compiled.
        fade: (WIDTH,) address of its `fade`, or 0: it has none.
        prior: (WIDTH,) likewise of its `adapt_prior`.
        gain: (WIDTH,) likewise of its `adapt_gain`.
        memory: (WIDTH, any) what it remembers, zero at the start.
        sizes: (WIDTH,) how much of that is its own.
    """

    parameters: FloatMatrix
    adapt: IntVector
    fade: IntVector
    prior: IntVector
    gain: IntVector
    memory: FloatMatrix
    sizes: IntVector


class Kept(NamedTuple):
    """Room for what the runs leave.

    Attributes:
        w: the array in which the runs live; its end holds the sums.
        reference: (k,) rows of the reference that were visited.
        x: (k, 6, WIDTH) position and velocity there; or no row.
        P: (k, 36, WIDTH) their covariance; or no row.
        errors: (marks, MARKED, WIDTH) what is kept of the marked rows.
        which: (m,) rows of z that were taken.
        seen: (m, SEEN, WIDTH) what each update saw: rows, nis, rows kept, nis used, innovation (6), diagonal of R (6),
            det S with the reported R; or one row, which each update writes anew.
    """

    w: FloatVector
    reference: IntVector
    x: FloatCube
    P: FloatCube
    errors: FloatCube
    which: IntVector
    seen: FloatCube


class Runs(NamedTuple):
    """What the runs show to the adaptation, run by run without gaps; the ends of the rows mean nothing.

    Attributes:
        HPHt: (WIDTH, 40).
        y: (WIDTH, 8) innovation.
        kept: (WIDTH, 8) 1 where a row is used, else 0.
        given: (WIDTH, 40) R, as the adaptation gets it.
        adapted: (WIDTH, 40) R, as the adaptation says.
        variance: (WIDTH, 8) its diagonal, before rows without a finite one are left out.
        some: (114,) the same of one run, where some rows are missing.
        rows: (6,) which these are.
        since: (WIDTH, 2 N N) A and Q of one axis, from the last update of each run to this one.
        whole: (S + 4 S S,) room for the state of one run as `Whole` has it.
        own: (WIDTH, 2 + S + S S) of a run with a gain of its own 1, LOST, x and P after this update; of any other 0.
    """

    HPHt: FloatMatrix
    y: FloatMatrix
    kept: FloatMatrix
    given: FloatMatrix
    adapted: FloatMatrix
    variance: FloatMatrix
    some: FloatVector
    rows: IntVector
    since: FloatMatrix
    whole: FloatVector
    own: FloatMatrix


class Packed(NamedTuple):
    """What an adaptation sees of the m rows that are there, and what it says; each may be longer than it says here.

    Attributes:
        rows: (6,) the first m: which rows of z they are.
        y: (6,) the first m: innovation.
        HPHt: (36,) the first m m.
        R: (36,) the first m m.
        adapted: (36,) the first m m: what the adaptation returns.
    """

    rows: IntVector
    y: FloatVector
    HPHt: FloatVector
    R: FloatVector
    adapted: FloatVector


class Whole(NamedTuple):
    """The state of one run in whole matrices, and room for an answer of that size.

    Attributes:
        x: (S,) prior state.
        P: (S S,) its covariance.
        F: (S S,) transition since the last update.
        Q: (S S,) process noise since then.
        answer: (S S,) what the adaptation returns: P, or K in the first numbers.
    """

    x: FloatVector
    P: FloatVector
    F: FloatVector
    Q: FloatVector
    answer: FloatVector


def empty_runs(n: int, width: int) -> Runs:
    """Make room for ``width`` runs of a filter with ``n`` quantities on each axis."""
    HPHt, given, adapted = (aligned_zeros(width, MATRIX) for _ in range(3))
    y, kept, variance = (aligned_zeros(width, SIX) for _ in range(3))
    since = np.tile(np.concatenate([np.eye(n).ravel(), np.zeros(n * n)]), (width, 1))
    s = 3 * n
    room = np.zeros(114), np.zeros(6, dtype=np.int64), since, np.zeros(s + 4 * s * s), np.zeros((width, 2 + s + s * s))
    return Runs(HPHt, y, kept, given, adapted, variance, *room)


def packed_of(runs: Runs) -> Packed:
    """Point at what an adaptation sees where some rows are missing, and at room for what it says."""
    some = runs.some
    return Packed(runs.rows, some[108:114], some[:36], some[36:72], some[72:108])
