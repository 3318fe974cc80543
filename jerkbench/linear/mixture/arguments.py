"""Arguments of the compiled mixture besides those of its filters; WIDTH is the number of runs side by side."""

from typing import NamedTuple

from jerkbench.arrays import FloatCube, FloatMatrix, FloatStack


class Mixing(NamedTuple):
    """The filters that are mixed, and how; an axis L is WIDTH, or 1 where the runs have the same.

    Attributes:
        A: (COUNT, k, N N, L) of one axis, for each length of a step.
        b: (COUNT, k, N, L) likewise.
        Q: (COUNT, k, N N, L) likewise.
        triangular: whether every A is upper triangular with ones on its diagonal.
        x0: (COUNT, 3 N, WIDTH) mixed states at the start.
        P0: (COUNT, 9 N N, WIDTH) their covariances.
        transitions: (COUNT COUNT, WIDTH) Pi, row by row.
        weights: (COUNT, WIDTH) c, changed in place.
        mu: (COUNT, WIDTH) room for the probabilities.
        filters: (COUNT, LENGTH WIDTH) the arrays in which the filters live.
    """

    A: FloatStack
    b: FloatStack
    Q: FloatStack
    triangular: bool
    x0: FloatCube
    P0: FloatCube
    transitions: FloatMatrix
    weights: FloatMatrix
    mu: FloatMatrix
    filters: FloatMatrix
