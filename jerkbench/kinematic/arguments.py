"""The arguments of the compiled loops: named tuples of arrays, the record with the state of the runs, and signatures.

In this module, a stream is an array of shape (rows, ..., L). The last axis has L = 8 elements, one for each run, or L =
1 element if all runs have the same values.
"""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, FloatCube, FloatMatrix, FloatStack, IntVector
from jerkbench.compilation.compiled import not_inlined, numba_type
from jerkbench.compilation.vectors import aligned_zeros, in_lanes
from jerkbench.estimate import SUMS

SEEN_ROWS, SEEN_NIS, ROWS_USED, NIS_OF_USED, INNOVATION, VARIANCE, DETERMINANT, SEEN = 0, 1, 2, 3, 4, 10, 16, 17
"""Indices of the values of an update in `Output.seen`: number of measured rows, NIS, number of rows after the
adaptation, NIS after the adaptation, innovation (6), diagonal of the adapted R (6), and det S with the reported R. SEEN
is the number of these values."""

MARKED = 9
"""Number of values in a row of `Output.errors`: the position error (3), and the upper triangle of its covariance
(6)."""


class Steps(NamedTuple):
    """The time steps of the runs, and the inputs and measurements of these steps.

    Attributes:
        model: (n,) for each step, the row of A, b and Q for the length of the step, or -1 if the step length is zero.
        sample: (n,) for each step, the row of ``u`` that is the filter input.
        update: (n,) row of ``z`` that is used after each step, or -1 if no update follows the step. The rows of ``z``
            are numbered 0, 1, 2, ... in the order of the updates.
        reference: (n,) index 0, 1, 2, ... of the time stamp of the reference at the end of each step, or -1 if the
            reference has no time stamp there.
        u: stream (samples, 3) of filter inputs: acceleration in ENU [m/s2].
        z: stream (m, 6) of measured positions [m] and velocities [m/s] in ENU, with NaN for each axis that is not
            measured.
        R_true: stream (m, 6, 6) of true measurement covariances for the adaptation `oracle`. For all other adaptations,
            ``R_true`` has no rows.
        R: stream (m, 6, 6) of reported measurement covariances.
        scale: (3, 8) for each run, the factor on the R of position, the factor on the R of velocity [-], and the
            minimum variance in R.
    """

    model: IntVector
    sample: IntVector
    update: IntVector
    reference: IntVector
    u: FloatCube
    z: FloatCube
    R_true: FloatStack
    R: FloatStack
    scale: FloatMatrix


class Scoring(NamedTuple):
    """True values and weights for the errors at the k time stamps of the reference. With k = 0, no errors are summed.

    Attributes:
        mark: (k,) for each time stamp, the row of `Output.errors` that stores the error, or -1 if the error is not
            stored.
        counts: stream (m, 1) with 1 for each update that is counted in the NIS, otherwise 0.
        truth: stream (k, 6) of true positions [m] and velocities [m/s] in ENU.
        weights: (k, 4) weights of four error sums: position, position including the burn-in, velocity, and NEES of
            position and velocity.
        outage: stream (k, 1) with 1 during an outage, otherwise 0. ``outage`` has no rows if there is no outage.
        speeds: True if the velocity error is scored at one or more time stamps.
        consistency: True if the NEES e' P^-1 e is summed, and the position covariances of the rows with ``mark`` >= 0
            are stored.
        limit_m2: squared position error above which a run counts as diverged [m2].
    """

    mark: IntVector
    counts: FloatCube
    truth: FloatCube
    weights: FloatMatrix
    outage: FloatCube
    speeds: bool = False
    consistency: bool = False
    limit_m2: float = math.inf


class Model(NamedTuple):
    """The model of one axis of each filter, with n states per axis, for k step lengths.

    Attributes:
        A: stream (k, n, n) of transition matrices.
        b: stream (k, n) of input vectors.
        Q: stream (k, n, n) of process noise covariances.
    """

    A: FloatStack
    b: FloatCube
    Q: FloatStack


class Rules(NamedTuple):
    """The parameters and the memory of the adaptation of eight runs.

    All runs have the same adaptation, but its parameters may differ between runs.

    Attributes:
        parameters: (p, 8) for each run, all numbers in the parameters of the adaptation.
        memory: memory of the adaptation, which is zero at the start. The shape of ``memory`` is (size, 8) if one call
            of the adaptation processes all runs, otherwise (8, size).
        rows: (6,) buffer for the indices of the measured rows.
        called: True if the loop has to call the adaptation, which is False for the adaptation `none`.
        has_gain: True if the adaptation computes the Kalman gain.
    """

    parameters: FloatMatrix
    memory: FloatMatrix
    rows: IntVector
    called: bool
    has_gain: bool


class Output(NamedTuple):
    """Buffers for those results of the runs that the record `record_layout` does not store.

    Attributes:
        states: (k, 6) position and velocity of the first run at the time stamps of the reference. ``states`` has no
            rows if the trajectory is not stored.
        covariances: (k, 6, 6) covariances of ``states``.
        errors: (marks, MARKED, 8) position errors and their covariances at the time stamps that `Scoring.mark` selects.
        seen: (m, SEEN, 8) innovation, NIS and R of each update. ``seen`` has no rows if these values are not stored.
    """

    states: FloatMatrix
    covariances: FloatCube
    errors: FloatCube
    seen: FloatCube


def new_output(*, visits: int, marks: int, updates: int) -> Output:
    """Return buffers for ``visits`` stored states, ``marks`` stored errors and ``updates`` updates."""
    errors, seen = np.full((marks, MARKED, WIDE), np.nan), aligned_zeros(updates, SEEN, WIDE)
    return Output(np.empty((visits, 6)), np.empty((visits, 6, 6)), errors, seen)


Runs = Any
"""Eight runs: a record of `record_layout`, viewed as arrays of vectors. The record is passed to functions as one
pointer."""


@cache
def record_layout(n: int, s: int, further: tuple[tuple[str, tuple[int, ...]], ...] = ()) -> np.dtype[Any]:
    """Return the NumPy record type for the states and the buffers of eight runs.

    The last axis of each field has one element for each run.

    Args:
        n: number of states per axis. In a kinematic filter, x[3 a + i] is state a of axis i.
        s: total number of states of the filter.
        further: names and shapes of additional fields of the record.
    """
    shapes: dict[str, tuple[int, ...]] = {
        "x": (s,),  # state
        "P": (s, s),  # its covariance
        "stopped": (1,),  # positive if the run has failed or diverged, or if this index has no run
        "failed": (1,),  # positive if the adaptation has raised an error or returned NaN
        "ended": (1,),  # index of the step at which the run stopped, or -1 if the run has not stopped
        "sums": (SUMS,),  # error sums in the order of `jerkbench.estimate.Streamed`
        "seen": (SEEN,),  # values of the last update in the order of `Output.seen`
        "y": (6,),  # innovation, with 0 in the rows that are not used
        "R": (6, 6),  # measurement covariance, with 0 in the rows and columns that are not used
        "used": (6,),  # 1 for each measurement row that is used, otherwise 0
        "adapted": (6, 6),  # R that the adaptation returns
        "M": (6, 7 + s),  # the matrix [S | y | G] before and after the elimination
        "D": (6,),  # diagonal of D in S = L D L'
        "S_diagonal": (6,),
        "fine": (6,),  # 1 for each measured state whose variance in R is smaller than in P, otherwise 0
        "before": (s,),  # variance of each state from which the update starts
        "gain": (6, s),  # transposed gain K'
        "e": (6,),  # error of position and velocity
        "one": (1,),  # buffer with one number for each run
        "square": (s, s),  # buffer
        "shown": (s, s),  # covariance at a time stamp of the reference, if it is scored or stored
        "u": (6,),  # filter input of the current step
        "A_step": (n, n),  # A, b and Q of the current step
        "b_step": (6,),
        "Q_step": (n, n),
        "A": (n, n),  # A and Q since the last update, for runs that have a measurement at this update
        "Q": (n, n),
        "A_total": (n, n),  # A and Q since the last update of each run
        "Q_total": (n, n),
        "waiting": (1,),  # 1 if the adaptation has not been called yet for this update, otherwise 0
        "selected": (1,),  # 1 for each run that the current call of the adaptation processes, otherwise 0
        **dict(further),
    }
    return np.dtype([(name, np.float64, (*shape, WIDE)) for name, shape in shapes.items()])


def new_state(of: np.dtype[Any], initial: Mapping[str, FloatArray], runs: int) -> Any:  # noqa: ANN401 - a record
    """Return the initial record for a number of ``runs`` from one to eight.

    The argument ``of`` is the `record_layout`, and ``initial`` contains the initial values of fields of the record. All
    other numbers are zero.
    """
    state = aligned_zeros(of.itemsize // 8).view(of)[0]
    for name, values in initial.items():
        state[name][: len(values)] = values
    state["A_total"][:] = np.eye(len(state["A_total"]))[:, :, None]
    state["stopped"][0, runs:] = 1.0
    state["ended"][:] = -1.0
    return state


# Functions that read rows of streams.


def read(stream: FloatArray, row: int, into: FloatArray) -> None:
    """Copy a row of a stream (rows, numbers, L) to the array of vectors ``into``."""
    if stream.shape[2] == 1:
        for e in range(stream.shape[1]):
            into[e] = stream[row, e, 0]
    else:
        vectors = in_lanes(stream)
        for e in range(stream.shape[1]):
            into[e] = vectors[row, e]


@not_inlined
def read_matrix(stream: FloatArray, row: int, into: FloatArray) -> None:
    """Copy a row of a stream (rows, m, m, L) to the matrix of vectors ``into``."""
    if stream.shape[3] == 1:
        for a in range(len(into)):
            for b in range(len(into)):
                into[a, b] = stream[row, a, b, 0]
    else:
        vectors = in_lanes(stream)
        for a in range(len(into)):
            for b in range(len(into)):
                into[a, b] = vectors[row, a, b]


def copy_matrix(given: FloatArray, into: FloatArray) -> None:
    """Copy a square matrix of vectors."""
    for a in range(len(into)):
        for b in range(len(into)):
            into[a, b] = given[a, b]


# Signatures of the compiled functions.

Called = Callable[..., None]
"""A compiled adaptation, or its gain. The signature is `called_type`."""


def called_type() -> Any:  # noqa: ANN401 - numba has no types
    """Return the numba signature of a compiled adaptation, and of its gain.

    The arguments are parameters, selected, x, P, A, Q, y, R, rows, memory, result and failed.
    """
    from numba import types

    arrays = (FloatMatrix, FloatMatrix, FloatMatrix, *[FloatCube] * 3, FloatMatrix, FloatCube, IntVector)
    return types.void(*map(numba_type, (*arrays, FloatMatrix, FloatCube, FloatMatrix)))


def loop_type(of: np.dtype[Any], model: Any) -> Any:  # noqa: ANN401 - numba has no types
    """Return the numba signature of a loop over the time steps.

    Args:
        of: `record_layout` of the state.
        model: type of the named tuple that describes the filter.
    """
    from numba import from_dtype, types

    arrays = [numba_type(kind) for kind in (Steps, Scoring, model, Rules)]
    called = types.FunctionType(called_type())
    return types.void(*arrays, called, called, numba_type(Output), from_dtype(of))
