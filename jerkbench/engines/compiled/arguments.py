"""What the compiled loop of one run is called with, and what it fills."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray, IntArray


class Steps(NamedTuple):
    """The steps of a run, as in `jerkbench.timeline.timeline.Timeline`.

    Attributes:
        model: (n,) which row of A, b, Q belongs to the step, or -1: no time passes.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of the reference, or -1.
        u: (samples, 3) the input.
        z: (m, 6) measurements, NaN where there is none.
        R: (m, 6, 6) what the adaptation gets.
        reported: (m, 6, 6) what the receiver reported.
    """

    model: IntArray
    sample: IntArray
    update: IntArray
    reference: IntArray
    u: FloatArray
    z: FloatArray
    R: FloatArray
    reported: FloatArray


class Model(NamedTuple):
    """The filter.

    Attributes:
        A: (k, N, N) of one axis, for each length of a step.
        b: (k, N) likewise.
        Q: (k, N, N) likewise.
        x0: (S,) initial state.
        P0: (S, S) its covariance.
        triangular: whether every A is upper triangular with ones on its diagonal.
    """

    A: FloatArray
    b: FloatArray
    Q: FloatArray
    x0: FloatArray
    P0: FloatArray
    triangular: bool


class Rule(NamedTuple):
    """The adaptation.

    Attributes:
        parameters: its numbers.
        memory: what it remembers, zero.
        adapt: address of its `adapt`, compiled.
        fade: address of its `fade`, or 0: it has none.
    """

    parameters: FloatArray
    memory: FloatArray
    adapt: int
    fade: int


class Kept(NamedTuple):
    """Room for what a run produces, as in `jerkbench.estimate`.

    Attributes:
        reference: (k,) its rows.
        x: (k, 6) position and velocity.
        P: (k, 36) their covariance.
        which: (m,) rows of z.
        rows: (m,) number of rows of each update.
        nis: (m,) with the reported R.
        nis_used: (m,) with the R that was used.
        innovation: (m, 6), NaN.
        R: (m, 6) diagonal, NaN.
    """

    reference: IntArray
    x: FloatArray
    P: FloatArray
    which: IntArray
    rows: FloatArray
    nis: FloatArray
    nis_used: FloatArray
    innovation: FloatArray
    R: FloatArray


class Packed(NamedTuple):
    """What an adaptation sees of the m rows that are there, and what it says; each may be longer than it says here.

    Attributes:
        rows: (6,) the first m: which rows of z they are.
        y: (6,) the first m: innovation.
        HPHt: (36,) the first m m.
        R: (36,) the first m m.
        adapted: (36,) the first m m: what the adaptation returns.
    """

    rows: IntArray
    y: FloatArray
    HPHt: FloatArray
    R: FloatArray
    adapted: FloatArray
