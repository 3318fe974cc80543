"""The arguments of the compiled loop, and the parts of the runs that it works on. WIDTH is the number of runs."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatCube, FloatMatrix, FloatVector, IntArray, IntVector
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import Lanes, View, fields_of
from jerkbench.estimate import NEES, SUMS

SIX, MATRIX = 8, 40
"""Six numbers, and 36, with room up to the next whole eight."""

SEEN = 17
"""Numbers that are kept of what an update saw."""

MARKED = 9
"""Numbers that are kept of a marked row: the position error (3), and the upper triangle of its covariance (6)."""


class Steps(NamedTuple):
    """The steps that the runs share, and in vectors (a last axis of WIDTH) what they do not.

    The runs of one recording share it: then W is 1, else WIDTH.

    Attributes:
        model: (n,) row of A, b, Q, or -1: no time passes.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of the reference, or -1.
        u: (samples, 3, W).
        z: (m, 6, W) measurements, NaN where there is none.
        R: (m, 36, W) what the adaptation gets; or no row where that is what it is told.
        reported: (m, 36, W) what the receiver reported; (m, 12, W) of each row those of its axis, where that is all.
        told: (3, WIDTH) factors on that of position and of velocity, and the least variance; of one run none.
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
    told: FloatMatrix
    x0: FloatMatrix
    P0: FloatMatrix


class TruthRows(NamedTuple):
    """The k rows of the reference that are visited, and what each counts for; W as in `Steps`. No row: no scoring.

    Attributes:
        mark: (k,) row of the errors that are kept, or -1.
        counts: (m, W) 1 where an update counts, else 0.
        truth: (k, 6, W).
        weights: (k, 4) in the order of `WEIGHTS`.
        outage: (k, W) 1 where a row counts for the outages, else 0; or no row where there are none.
        speeds: whether any row counts for the velocity.
        consistency: whether e' P^-1 e is summed up, and the covariance of a marked row kept.
        limit_m2: the square of a position error beyond which a run strays.
    """

    mark: IntVector
    counts: FloatMatrix
    truth: FloatCube
    weights: FloatMatrix
    outage: FloatMatrix
    speeds: bool = False
    consistency: bool = False
    limit_m2: float = math.inf


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
    """The adaptation of each run; or one that all runs ask at once, in vectors (a last axis of WIDTH).

    Attributes:
        parameters: (WIDTH, any) its numbers; (any, WIDTH) of all runs at once.
        whole: (any,) of all runs at once the same, where they are whole numbers and so the same; else nothing.
        adapt: (WIDTH,) address of its `adapt`, compiled; or 0 if it changes nothing and is not called.
        fade: (WIDTH,) address of its `fade`, or 0: it has none.
        prior: (WIDTH,) likewise of its `adapt_prior`.
        gain: (WIDTH,) likewise of its `adapt_gain`.
        memory: (WIDTH, any) what it remembers, zero at the start; (any, WIDTH) of all at once, and room for as much.
        sizes: (WIDTH,) how much of that is its own.
    """

    parameters: FloatMatrix
    whole: IntVector
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
        reference: (k,) rows of the reference that were visited; or no row.
        x: (k, 6, WIDTH) position and velocity there; or no row.
        P: (k, 36, WIDTH) their covariance; or no row.
        errors: (marks, MARKED, WIDTH) what is kept of the marked rows.
        which: (m,) rows of z that were taken.
        seen: (m, SEEN, WIDTH) what each update saw: rows, nis, rows kept, nis used, innovation (6), diagonal of R (6),
            det S with the reported R; or one row, of which each update writes the first two.
    """

    w: FloatVector
    reference: IntVector
    x: FloatCube
    P: FloatCube
    errors: FloatCube
    which: IntVector
    seen: FloatCube


class Exchange(NamedTuple):
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
        whole: (S + 4 S S,) room for the state of one run as `Whole` has it.
        states: S, which as a constant would make the compiler unroll the loops.
    """

    HPHt: FloatMatrix
    y: FloatMatrix
    kept: FloatMatrix
    given: FloatMatrix
    adapted: FloatMatrix
    variance: FloatMatrix
    some: FloatVector
    rows: IntVector
    whole: FloatVector
    states: int


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


def exchange_for(of: Lanes) -> Exchange:
    """Make room for runs of this type."""
    width, s = of.width, of.sizes["s"]
    room = aligned_zeros(3 * (MATRIX + SIX), width)
    HPHt, given, adapted = (room[k * MATRIX : (k + 1) * MATRIX].reshape(width, MATRIX) for k in range(3))
    y, kept, variance = (room[3 * MATRIX + k * SIX :][:SIX].reshape(width, SIX) for k in range(3))
    some, rows, whole = np.zeros(114), np.zeros(6, dtype=np.int64), np.zeros(s + 4 * s * s)
    return Exchange(HPHt, y, kept, given, adapted, variance, some, rows, whole, s)


def packed_of(exchange: Exchange) -> Packed:
    """Point at what an adaptation sees where some rows are missing, and at room for what it says."""
    some = exchange.some
    return Packed(exchange.rows, some[108:114], some[:36], some[36:72], some[72:108])


# The parts of a run, and where in its array they lie.
#
# Every element holds one number of each run. The covariance P[s, t], s = 3 a + i of quantity a and axis i, lies by
# pairs of axes (i, j), i <= j, because F = A (x) I3 is the same product for each pair; of equal axes half is used. Of
# one run the six pairs stand side by side, because one vector then holds the same element of all of them; of several
# runs each pair has a matrix of its own.

PAIRS = 6
"""Pairs of axes: (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)."""

FIRST_AXIS, SECOND_AXIS = [0, 0, 0, 1, 1, 2, 2, 2], [0, 1, 2, 1, 2, 2, 2, 2]
"""The axes of each pair; two more fill a vector."""

WEIGHTS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

_SHAPES: dict[str, tuple[int, ...]] = {
    "L": (6, 6),  # of S = H P H' + R = L D L', below its diagonal
    "S_diagonal": (6,),
    "R": (6, 6),  # as the adaptation says, by row of z
    "white": (6,),  # L^-1 y
    "y": (6,),  # innovation by row of z, 0 where a row is not used
    "used": (6,),  # 1 where a row is used, else 0
    "variance": (6,),  # diagonal of R, also of a row that it leaves out; NaN where there is none
    "fine": (6,),  # 1 where a row is used and its R is less than H P H', else 0
    "doubt": (),  # above 0 where what an update leaves of a variance may be rounding
    "lost": (),  # above 0 once a matrix was not positive definite
    "coupled": (),  # above 0 once an adapted R had a covariance of two axes, where those are left out
    "ended": (),  # step at whose end that was, or -1
    "waits": (),  # 1 where an adaptation of all runs at once is still to be asked
    "asks": (),  # 1 where it is being asked
    "between": (),  # squares of what it then put between two axes
    "own": (),  # 1 where this update has a gain of its own, which then stands in Z
    "due": (),  # above 0 where an update has a row
    "e": (6,),  # error of position and velocity
    "sums": (SUMS,),  # of the whole run: `jerkbench.estimate.Streamed`
}


@cache
def run_type(n: int, width: int, **sizes: int) -> Lanes:
    """Return the type of ``width`` runs of a filter with ``n`` quantities on each axis; ``sizes`` are further ones."""
    return type_with({}, 3 * n, width, **sizes)


def type_with(more: Mapping[str, tuple[int, ...]], s: int, width: int, **sizes: int) -> Lanes:
    """Return the type of runs of ``s`` states with ``more`` fields of these shapes."""
    n = -(-s // 3)
    first = {"Y": (6, n, WIDE if width == 1 else 3)}  # so that each vector lies in one line of the cache
    shapes = {**first, **_SHAPES, "x": (s,), "Z": (6, s), **more}  # Z: S^-1 G, or K' of an own gain
    shapes |= {"since_A": (n, n), "since_Q": (n, n)}  # of one axis, from the last update to this one
    shapes |= {"gone_A": (n, n), "gone_Q": (n, n)}  # likewise, from where P was predicted to the state
    shapes |= {"usual_A": (n, n), "usual_Q": (n, n)}  # of as many steps as there mostly are between two updates
    shapes |= {"scored": (PAIRS, n, n)}  # side by side, a P that goes on at each step: `jerkbench.kinematic.predict`
    run = with_covariance(shapes, s, width)
    over_D = View((6,), run.fields["L"].places[::7], width)  # 1/D stands on the diagonal of L
    P_scored = View((s, s), _square(run.fields["scored"].places, s).ravel().tolist(), width)
    return Lanes(
        {**run.fields, "over_D": over_D, "P_scored": P_scored, **_by_pairs(run.fields["P"], run.fields["Y"], s, width)},
        {**run.sizes, "seen": SEEN, "marked": MARKED, "errors": NEES, "related": 6, **sizes},
        width,
    )


def _by_pairs(P: View, stored: View, s: int, width: int) -> dict[str, View]:
    """Y = L^-1 G of an update. Of one run also H P and Y as vectors: of each pair of axes, the first or the second.

    Numbers of no pair, and of states beyond the last, come to lie where no state is.
    """
    n, whole = -(-s // 3), np.reshape(stored.places, stored.shape)
    Y = whole[:, :, [0, 3, 5]] if width == 1 else whole
    W = np.pad(np.reshape(P.places, P.shape)[:6], ((0, 0), (0, 3 * n - s)), mode="edge").reshape(Y.shape)
    parts = {"W_first": W[:, :, FIRST_AXIS], "Y_first": Y[:, :, FIRST_AXIS], "Y_second": Y[:, :, SECOND_AXIS]}
    parts["Y"] = Y.reshape(6, -1)[:, :s]
    views = {name: View(places.shape, places.ravel().tolist(), width) for name, places in parts.items()}
    return {**views, "Y_pairs": View((6, n), whole[:, :, 0].ravel().tolist(), WIDE)}


def with_covariance(shapes: Mapping[str, tuple[int, ...]], s: int, width: int) -> Lanes:
    """Return the type of runs that have a covariance of ``s`` states, and fields of these ``shapes``.

    Their quantities on each axis are n = s/3, rounded up: what is left over of the last one is never used.
    """
    n, alone = -(-s // 3), width == 1
    stored = {"blocks": (n, n, WIDE) if alone else (PAIRS, n, n), "sames": (WIDE,)}
    views, length = fields_of({**stored, **shapes}, width)
    blocks = list(views.pop("blocks").places)
    pairs = blocks[::WIDE] if alone else blocks[: n * n]
    if alone:
        blocks = np.reshape(blocks, (n, n, WIDE))[:, :, :PAIRS].transpose(2, 0, 1).ravel().tolist()
    P = _square(blocks, s)
    six = np.pad(P[:, :6], ((0, 0), (0, 2)), mode="edge")
    views["block"] = View((PAIRS, n, n), blocks, width)
    views["pairs"] = View((n, n), pairs, WIDE)  # of one run: the same element of all pairs
    views["same"] = View((), views.pop("sames").places[:1], WIDE)  # of one run: 1 for an axis with itself
    views["P"] = View((s, s), P.ravel().tolist(), width)
    views["P_measured"] = View((6, 6), P[:6, :6].ravel().tolist(), width)  # of position and velocity: H P H'
    views["P_six"] = View((s, WIDE), six.ravel().tolist(), width)  # six columns, and two that mean nothing
    return Lanes(views, {"n": n, "s": s, "length": length}, width)


def _square(blocks: Sequence[int], s: int) -> IntArray:
    """Where each P[s, t] lies, of (6, n, n) blocks of places."""
    n = -(-s // 3)
    (a, i), (b, j) = np.divmod(np.arange(s)[:, None], 3), np.divmod(np.arange(s), 3)
    swapped = (i > j) | ((i == j) & (a > b))
    a, b, i, j = np.where(swapped, b, a), np.where(swapped, a, b), np.minimum(i, j), np.maximum(i, j)
    return np.asarray(np.asarray(blocks)[n * n * (i * (5 - i) // 2 + j) + n * a + b])


RUN = run_type(3, WIDE)
"""The type of the runs at hand: a compilation replaces it."""

EACH, AT_ONCE = range(2)
"""How the adaptation is called: for each run separately, or for all runs at once."""

ASKED = EACH
"""Which of these, likewise."""

STRIDE = 1
"""1; or 3 where axes have nothing to do with each other (R has no covariance of two) and errors alone are asked for:
then each axis is gone over by itself, every third row, state and column. Likewise."""

DENSE = 1
"""Whether an adaptation of these runs sees whole matrices, likewise: they are shown to nobody else."""
