"""The measurement update of a Kalman filter in NumPy, and its limits due to double precision."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

ROUNDING = 1e-12
"""A posterior variance below this fraction of its spread (`spread_by`) is a rounding error, not information.

Doubles have 16 digits, so the relative error of a variance at this limit is 1e-4. Such variances occur if a long gap
makes the states linearly dependent, for example with `jerk` over 100 s in one step: p = 166 667 j and v = 5 000 j.
"""

EXPOSED = 1e-3
"""A rounding error (`rounding_noise`) is added to a posterior variance below this fraction of its spread.

Above this fraction, a relative error u of the spread is an error of 1e-13 of the posterior variance. This error is less
than `ROUNDING`, so a second update cannot reduce the variance to the size of the error. With a limit of 1e-6 instead of
1e-3, a second update could do so: the first of two precise rows leaves 1e-5 of the variance and the second leaves 3e-12
of this rest, so that the sign of the rounding error would decide which run ends.
"""

FLOOR = 1e-15
"""The rounding error that `rounding_noise` adds to a variance, as a fraction of the spread of the variance.

The value is nine units of rounding u, which cover the factor of S and the preceding prediction. If the prior is
numerically singular, the posterior without this term consists of rounding errors of either sign. The next precise row
removes the rest of the variance, and the sign of the error decides which run ends. The term increases a variance by at
most FLOOR / ROUNDING = 1e-3, and by FLOOR / EXPOSED = 1e-12 at the limit below which it is added.
"""

SYMMETRIC = 1e-12
"""Maximum asymmetry of S, relative to sqrt(S_ii S_jj)."""

INDEFINITE = 1e-3
"""Maximum magnitude of a negative eigenvalue that counts as a rounding error, for a covariance with a unit diagonal.

Variances that pass `ROUNDING` have relative errors of up to 1e-4, and the errors of ten states add up. The eigenvalues
after an update with an R that is not positive definite are far below this limit. Without this tolerance, rounding
errors would decide which run ends: after a step of 100 s with `acceleration`, the smallest eigenvalue is 2e-12, and
every form of the update has errors of 1e-11.
"""


def submatrix(A: FloatArray, rows: IntArray) -> FloatArray:
    """Return the submatrix H A H' of the rows and columns ``rows`` of A, in loops that numba compiles."""
    HAHt = np.empty((len(rows), len(rows)), A.dtype)
    for i in range(len(rows)):
        for j in range(len(rows)):
            HAHt[i, j] = A[rows[i], rows[j]]
    return HAHt


def innovation_factor(S: FloatArray) -> FloatArray | None:
    """Return the Cholesky factor L of S (m, m), or None if S is not numerically symmetric and positive definite."""
    variances = np.diag(S)
    if not (variances > 0).all():  # NaN fails this comparison
        return None
    sigma = np.sqrt(variances)
    if not (np.abs(S - S.T) <= SYMMETRIC * sigma[:, None] * sigma).all():
        return None
    try:
        L = np.asarray(np.linalg.cholesky(S), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    return L if (np.diag(L) ** 2 > ROUNDING * variances).all() else None


def squared_distance(y: FloatArray, S: FloatArray) -> float:
    """Return y' S^-1 y."""
    return float(y @ np.linalg.solve(S, y))


def squared_distance_by(y: FloatArray, L: FloatArray) -> float:
    """Return y' S^-1 y, where L is the Cholesky factor of S."""
    white = np.linalg.solve(L, y)
    return float(white @ white)


def moved(PHt: FloatArray, y: FloatArray, R: FloatArray, L: FloatArray, measured: IntArray) -> FloatArray:
    """Return the state change K y (n,). Row i of z measures the state ``measured[i]``. L is the Cholesky factor of S.

    With v = S^-1 y, K y is equal to P H' v. For a measured state, P H' v is equal to y - R v. The expression y - R v is
    more accurate if R is smaller than P.
    """
    from scipy.linalg import cho_solve  # imported here, because the import takes a tenth of a second

    v = cho_solve((L, True), y, check_finite=False)
    step = np.asarray(PHt @ v, dtype=np.float64)
    finer = np.diag(R) < np.diag(PHt[measured])
    step[measured[finer]] = (y - R @ v)[finer]
    return step


def gain_and_rest(PHt: FloatArray, R: FloatArray, L: FloatArray, measured: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return K = P H' S^-1 (n, m) and I - K H (n, n). Row i of z measures the state ``measured[i]``.

    L is the Cholesky factor of S. A gain that is computed by solving with L satisfies K S = P H' up to rounding, for
    every scaling and condition number of S. If K were computed with the inverse of a nearly singular S, the error of K
    would exceed the posterior sigma. For a measured state, the row of I - K H is equal to the row of R S^-1. If R is
    smaller than P, R S^-1 is computed by solving with L, and K is computed from R S^-1. If 1 - K were computed from a
    gain of nearly one, the difference would be a rounding error, and the product of this error with P would dominate a
    small posterior variance.
    """
    from scipy.linalg import cho_solve  # imported here, because the import takes a tenth of a second

    K = np.asarray(cho_solve((L, True), PHt.T, check_finite=False).T, dtype=np.float64)
    residual_gain = np.asarray(cho_solve((L, True), R, check_finite=False).T, dtype=np.float64)
    finer = np.diag(R) < np.diag(PHt[measured])
    K[measured[finer]] = (np.eye(len(R)) - residual_gain)[finer]
    rest = without_measured(K, measured)
    rest[np.ix_(measured[finer], measured)] = residual_gain[finer]
    return K, rest


def spread_by(K: FloatArray, rest: FloatArray, P: FloatArray, R: FloatArray, measured: IntArray) -> FloatArray:
    """Return the spread (n,) q_s = P_ss + sum_i K_si^2 S_ii, to which rounding errors of variances are proportional.

    For a measured state whose R is smaller than P, the posterior is R S^-1 P, and the spread q_s is computed only from
    the row of R S^-1. If S and the prior have errors E with |E_ij| < c u sqrt(S_ii S_jj), the error of the posterior
    variance is K E K', which is less than c u (m + 1) q_s by the Cauchy-Schwarz inequality. If S is nearly singular, K
    is large and q_s exceeds the prior variance. A limit relative to the prior variance would then not distinguish
    rounding errors from information. The engines `filterpy` and `compiled` compute an accurate q_s, even if all digits
    of the posterior variance are wrong.
    """
    finer = np.diag(R) < np.diag(P)[measured]
    used, base = K.copy(), np.diag(P).copy()
    used[measured[finer]], base[measured[finer]] = rest[np.ix_(measured[finer], measured)], 0.0
    return np.asarray(base + used**2 @ (np.diag(P)[measured] + np.diag(R)), dtype=np.float64)


def rounding_noise(variances: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the rounding error (n,) to add to ``variances``. It is 0 for a variance above EXPOSED times the spread."""
    return np.where(variances < EXPOSED * spread, FLOOR * spread, 0.0)


def without_measured(K: FloatArray, measured: IntArray) -> FloatArray:
    """Return I - K H (n, n). Row i of z measures the state ``measured[i]``."""
    rest = np.eye(len(K))
    rest[:, measured] -= K
    return rest


def joseph(P: FloatArray, K: FloatArray, rest: FloatArray, R: FloatArray) -> FloatArray:
    """Return (I - K H) P (I - K H)' + K R K', made symmetric. ``rest`` is I - K H."""
    posterior = rest @ P @ rest.T + K @ R @ K.T
    return np.asarray(0.5 * (posterior + posterior.T), dtype=np.float64)


def updated(
    x: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and P after an update with any H (m, n), computed with the textbook equations."""
    PHt = P @ H.T
    K: FloatArray = np.asarray(np.linalg.solve(H @ PHt + R, PHt.T).T, dtype=np.float64)
    return x + K @ innovation, joseph(P, K, np.eye(len(x)) - K @ H, R)


def is_healthy(x: FloatArray, P: FloatArray) -> bool:
    """Return whether the state is finite and the covariance is positive definite."""
    return bool(np.isfinite(x).all()) and has_factor(P)


def has_factor(P: FloatArray) -> bool:
    """Return whether P is finite and has a Cholesky factor."""
    try:
        return bool(np.isfinite(P).all() and np.isfinite(np.linalg.cholesky(P)).all())
    except np.linalg.LinAlgError:
        return False


def is_positive_definite(P: FloatArray) -> bool:
    """Return whether P is finite and positive definite up to rounding: P + INDEFINITE diag(P) has a Cholesky factor."""
    return has_factor(P + INDEFINITE * np.diag(np.diag(P)))
