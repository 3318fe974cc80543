"""The compiled prediction with the transition matrix F, the Kronecker product of A with I3.

The same product with A is computed for each axis of x and for each pair of axes of P. The number n of states per axis
is the length of the tuple ``axis``, so that n is a constant when numba compiles the functions.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import not_inlined
from jerkbench.kinematic.arguments import Model, Runs, Steps, read, read_matrix

Axis = tuple[int, ...]


def predict_state(x: FloatArray, A: FloatArray, b: FloatArray, u: FloatArray, old: FloatArray, axis: Axis) -> None:
    """Compute x = A x + b u for each of the three axes, where ``old`` is a buffer."""
    for i in range(3):
        for a in range(len(axis)):
            old[a] = x[3 * a + i]
        for a in range(len(axis)):
            moved = b[a] * u[i]
            for c in range(len(axis)):
                moved += A[a, c] * old[c]
            x[3 * a + i] = moved


@not_inlined
def predict_covariance(P: FloatArray, A: FloatArray, Q: FloatArray, AP: FloatArray, axis: Axis) -> None:
    """Compute the predicted covariance P = F P F' + Q (x) I3, where ``AP`` is a buffer."""
    for i in range(3):
        for j in range(i, 3):
            _predict_pair(P, A, Q, AP, axis, i, j)


def _predict_pair(P: FloatArray, A: FloatArray, Q: FloatArray, AP: FloatArray, axis: Axis, i: int, j: int) -> None:
    """Predict the covariance between axis i and axis j, and the transposed block."""
    n = len(axis)
    for a in range(n):
        for c in range(n):
            product = A[a, 0] * P[i, 3 * c + j]
            for d in range(1, n):
                product += A[a, d] * P[3 * d + i, 3 * c + j]
            AP[a, c] = product
    for a in range(n):
        for c in range(a if i == j else 0, n):
            product = AP[a, 0] * A[c, 0]
            for d in range(1, n):
                product += AP[a, d] * A[c, d]
            if i == j:
                product += Q[a, c]
            P[3 * a + i, 3 * c + j] = P[3 * c + j, 3 * a + i] = product


def read_step(run: Runs, steps: Steps, model: Model, k: int) -> None:
    """Copy the values of step ``k`` to ``run``: the filter input u, and A, b and Q of the model."""
    length = steps.model[k]
    read(steps.u, steps.sample[k], run.u)
    read_matrix(model.A, length, run.A_step)
    read(model.b, length, run.b_step)
    read_matrix(model.Q, length, run.Q_step)


@not_inlined
def predict(run: Runs, x: FloatArray, P: FloatArray, steps: Steps, model: Model, k: int, axis: Axis) -> None:
    """Predict the state x and its covariance P over step ``k``."""
    read_step(run, steps, model, k)
    predict_state(x, run.A_step, run.b_step, run.u, run.e, axis)
    predict_covariance(P, run.A_step, run.Q_step, run.square, axis)


def compose(run: Runs, axis: Axis) -> None:
    """Add a step to the transition and process noise since the last update: A_step A and A_step Q A_step' + Q_step."""
    A, Q, A_step, AA, AQ, n = run.A_total, run.Q_total, run.A_step, run.square, run.M, len(axis)
    for a in range(n):
        for b in range(n):
            moved, noise = A_step[a, 0] * A[0, b], A_step[a, 0] * Q[0, b]
            for c in range(1, n):
                moved += A_step[a, c] * A[c, b]
                noise += A_step[a, c] * Q[c, b]
            AA[a, b], AQ[a, b] = moved, noise
    for a in range(n):
        for b in range(a, n):
            noise = run.Q_step[a, b]
            for c in range(n):
                noise += AQ[a, c] * A_step[b, c]
            Q[a, b] = Q[b, a] = noise
        for b in range(n):
            A[a, b] = AA[a, b]
