"""Arguments of the compiled smoother besides those of its filter; WIDTH is the number of runs side by side."""

from typing import NamedTuple

from jerkbench.arrays import FloatMatrix, FloatVector, IntVector


class Tape(NamedTuple):
    """Room for what the backward pass needs.

    Attributes:
        step: (rows,) the step after which the row was written; -1: the start.
        updated: (rows,) 1 where that step ended with an update.
        rows: (rows, any) filtered states, and what the updates made of them.
        between: (SEGMENT, any) states between two rows.
        moving: (LENGTH WIDTH,) the filter that is predicted once more.
        adjoint: (LENGTH WIDTH,) lambda in the place of the state, Lambda in that of the covariance.
    """

    step: IntVector
    updated: IntVector
    rows: FloatMatrix
    between: FloatMatrix
    moving: FloatVector
    adjoint: FloatVector
