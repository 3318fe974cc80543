"""Arguments of the compiled mixture."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray, IntArray


class Steps(NamedTuple):
    """The steps of a run, as in `jerkbench.timeline.timeline.Timeline`.

    Attributes:
        model: (n,) row of A, b, Q, or -1: no time passes.
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


class Models(NamedTuple):
    """The filters that are mixed, and how.

    Attributes:
        A: (filters, k, N, N) of one axis, for each length of a step.
        b: (filters, k, N) likewise.
        Q: (filters, k, N, N) likewise.
        transitions: (filters, filters) Pi.
        weights: (filters,) c, changed in place.
        mu: (filters,) room for the probabilities.
        joint: (filters,) room for the weights of one mixture.
    """

    A: FloatArray
    b: FloatArray
    Q: FloatArray
    transitions: FloatArray
    weights: FloatArray
    mu: FloatArray
    joint: FloatArray


class Kept(NamedTuple):
    """Room for what a run leaves; where there is one row, each state or update writes it anew.

    Attributes:
        reference: (k,) rows of the reference that were visited.
        x: (k, 6) position and velocity there.
        P: (k, 36) their covariance.
        which: (m,) rows of z that were taken.
        seen: (m, SEEN) what each update saw.
        order: (6,) room for the numbers of rows.
        rows: (6,) likewise.
    """

    reference: IntArray
    x: FloatArray
    P: FloatArray
    which: IntArray
    seen: FloatArray
    order: IntArray
    rows: IntArray
