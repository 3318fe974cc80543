"""What the compiled loop of several runs is called with, and what it fills."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.engines.compiled.lanes.runs import Runs

SEEN = 16
"""Numbers that are kept of what an update saw."""


class LaneSteps(NamedTuple):
    """The steps that the runs share, and in vectors (a last axis of WIDTH) what they do not.

    Attributes:
        model: (n,) row of A, b, Q, or -1.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of truth, or -1.
        mark: (k,) row of the errors that are kept, or -1.
        complete: (m,) 1 where all rows of all runs are there, else 0.
        u: (samples, 3, WIDTH).
        z: (m, 6, WIDTH), 0 where there is none.
        kept: (m, 6, WIDTH) 1 where a row is there, else 0.
        R: (m, 21, WIDTH) lower triangle of what the adaptation gets; or no row where that is what was reported.
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
    complete: IntArray
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
        runs: room for what the runs show to the adaptation.
        room: (114,) the same, where some rows are missing.
        rows: (6,) the same.
    """

    w: FloatArray
    memory: FloatArray
    errors: FloatArray
    seen: FloatArray
    runs: Runs
    room: FloatArray
    rows: IntArray
