"""The measurement update of a Kalman filter in NumPy, and the limit of double precision."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

ROUNDING = 1e-12
"""A variance that is left over when all but this share is taken away is rounding, not information (`spread_by`).

Doubles carry 16 digits, so what is left has an error of 1e-4 of itself by then. It happens where a long gap makes the
states depend on each other, as with `jerk` over 100 s in one step: p = 166 667 j and v = 5 000 j.
"""

EXPOSED = 1e-3
"""Below this share of what an update takes away, what it leaves is widened by rounding (`rounding_noise`).

Above it an error of u of the whole is 1e-13 of what is left. That is less than `ROUNDING`: a second update cannot take
away all but the error. It could if widening began at a millionth: of two precise rows the first leaves 1e-5 of a
variance, the second 3e-12 of the rest, and the sign of the error decides which run ends.
"""

FLOOR = 1e-15
"""What rounding is taken for there, as a share of the same.

Nine units of rounding u: some for the factors of S, some for the prediction before. Without it the posterior keeps the
noise alone where the prior is singular to rounding, of either sign; the next precise row takes away what is left beside
it, and its sign decides which run ends. A variance gets wider by FLOOR / ROUNDING, a thousandth, at the very limit, by
FLOOR / EXPOSED, a millionth of a millionth, where it begins.
"""

SYMMETRIC = 1e-12
"""The largest difference between the two halves of S, as a part of sqrt(S_ii S_jj)."""

INDEFINITE = 1e-3
"""How far below zero rounding may take an eigenvalue of a covariance that is scaled to ones on its diagonal.

What `ROUNDING` lets through has errors of 1e-4 of its variances, and ten states add them up. A rule that gave an R that
is not positive definite goes far beyond. Without a margin rounding would decide which run ends: after 100 s in one step
of `acceleration` the smallest eigenvalue is 2e-12, and every form of the update has errors of 1e-11 there.
"""


def innovation_factor(S: FloatArray) -> FloatArray | None:
    """Return L of S = L L', or None where S (m, m) is not symmetric and positive definite beyond rounding."""
    variances = np.diag(S)
    if not (variances > 0).all():  # NaN is not, either
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
    """Return the same by the factor of S = L L'."""
    white = np.linalg.solve(L, y)
    return float(white @ white)


def moved(PHt: FloatArray, y: FloatArray, R: FloatArray, L: FloatArray, measured: IntArray) -> FloatArray:
    """Return K y (n,); rows of z are the states ``measured`` themselves, and L is the factor of S.

    With v = S^-1 y it is P H' v, of a measured state y - R v as well: that is the better one where R is the smaller.
    """
    from scipy.linalg import cho_solve  # a tenth of a second

    v = cho_solve((L, True), y, check_finite=False)
    step = np.asarray(PHt @ v, dtype=np.float64)
    finer = np.diag(R) < np.diag(PHt[measured])
    step[measured[finer]] = (y - R @ v)[finer]
    return step


def gain_and_rest(PHt: FloatArray, R: FloatArray, L: FloatArray, measured: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return K = P H' S^-1 (n, m) and I - K H (n, n); rows of z are the states ``measured``, and L is the factor of S.

    K S = P H' holds to rounding then, however S is scaled and conditioned; with the inverse of S it does not: where S
    is nearly singular that K is wrong by more than the posterior's sigma. Of a measured state the row of I - K H is
    that of R S^-1, and where R is the smaller one that is solved for, and K is what is left of one: one less a gain of
    nearly one would be rounding, and that times P all of a small posterior.
    """
    from scipy.linalg import cho_solve  # a tenth of a second

    K = np.asarray(cho_solve((L, True), PHt.T, check_finite=False).T, dtype=np.float64)
    own = np.asarray(cho_solve((L, True), R, check_finite=False).T, dtype=np.float64)
    finer = np.diag(R) < np.diag(PHt[measured])
    K[measured[finer]] = (np.eye(len(R)) - own)[finer]
    rest = without_measured(K, measured)
    rest[np.ix_(measured[finer], measured)] = own[finer]
    return K, rest


def spread_by(K: FloatArray, rest: FloatArray, P: FloatArray, R: FloatArray, measured: IntArray) -> FloatArray:
    """Return (n,) what the posterior variances are left of, q_s = P_ss + sum_i K_si^2 S_ii.

    Of a measured state whose R is the smaller, the posterior is R S^-1 P, and q_s is that of the row of R S^-1 alone.
    Where S is wrong by E and the prior likewise, |E_ij| < c u sqrt(S_ii S_jj), that variance is wrong by K E K', which
    is less than c u (m + 1) q_s by Cauchy's inequality. A nearly singular S makes K large: then q_s is more than the
    prior variance, of which the share would not tell rounding from information. Both engines know q_s to many digits
    where they know nothing of what is left of it.
    """
    finer = np.diag(R) < np.diag(P)[measured]
    used, base = K.copy(), np.diag(P).copy()
    used[measured[finer]], base[measured[finer]] = rest[np.ix_(measured[finer], measured)], 0.0
    return np.asarray(base + used**2 @ (np.diag(P)[measured] + np.diag(R)), dtype=np.float64)


def rounding_noise(variances: FloatArray, spread: FloatArray) -> FloatArray:
    """Return (n,) what is added to posterior ``variances`` for rounding, nothing where more is left of ``spread``."""
    return np.where(variances < EXPOSED * spread, FLOOR * spread, 0.0)


def without_measured(K: FloatArray, measured: IntArray) -> FloatArray:
    """Return I - K H (n, n); rows of z are the states ``measured``."""
    rest = np.eye(len(K))
    rest[:, measured] -= K
    return rest


def joseph(P: FloatArray, K: FloatArray, rest: FloatArray, R: FloatArray) -> FloatArray:
    """Return (I - K H) P (I - K H)' + K R K', symmetrised; ``rest`` is I - K H."""
    posterior = rest @ P @ rest.T + K @ R @ K.T
    return np.asarray(0.5 * (posterior + posterior.T), dtype=np.float64)


def updated(
    x: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and P after an update with rows H (m, n) of any kind: the plain text, for a definition in NumPy."""
    PHt = P @ H.T
    K: FloatArray = np.asarray(np.linalg.solve(H @ PHt + R, PHt.T).T, dtype=np.float64)
    return x + K @ innovation, joseph(P, K, np.eye(len(x)) - K @ H, R)


def is_healthy(x: FloatArray, P: FloatArray) -> bool:
    """Whether the state is finite and the covariance positive definite."""
    return bool(np.isfinite(x).all()) and has_factor(P)


def has_factor(P: FloatArray) -> bool:
    """Whether P is finite and has a Cholesky factor."""
    try:
        return bool(np.isfinite(P).all() and np.isfinite(np.linalg.cholesky(P)).all())
    except np.linalg.LinAlgError:
        return False


def is_positive_definite(P: FloatArray) -> bool:
    """Whether P is finite and positive definite but for rounding: P + INDEFINITE diag(P) has a factor."""
    return has_factor(P + INDEFINITE * np.diag(np.diag(P)))
