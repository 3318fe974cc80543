"""Filters of the literature with full matrices, where prior and measurement are stacked.

Each filter follows the equations of its paper with x, P, z, H and R, matrix inverses and weighted least squares. The
treatment of absent rows, memories and rounding errors by the plugins is not included.
"""

import numpy as np
from scipy.linalg import block_diag

from plain_filter import update


def least_squares(x, P, z, H, R, weights):
    """Return the weighted least-squares state of the whitened stack [x; z], its residuals, and the covariances."""
    n = len(x)
    root = np.linalg.cholesky(block_diag(P, R))
    W, D = np.linalg.solve(root, np.vstack([np.eye(n), H])), np.linalg.solve(root, np.concatenate([x, z]))
    stack = root @ np.diag(1.0 / weights) @ root.T
    C = np.sqrt(weights)  # normal equations would lose half the digits with weights of 1e-8
    best = np.linalg.lstsq(C[:, None] * W, C * D, rcond=None)[0]
    return best, D - W @ best, (stack[:n, :n], stack[n:, n:])


def reweighted(prior, z, H, R, weight, sides, start="update"):
    """Return (x, P~, R~) at the fixed point of the weights, which start from the prediction or the update."""
    n, last = len(prior.x), prior.x
    weights = np.ones(n + len(z))
    if start == "prediction":
        weights[n:] = np.maximum(weight(np.linalg.solve(np.linalg.cholesky(R), z - H @ prior.x)), 1e-8)
    for _ in range(50):
        x, residual, covariances = least_squares(prior.x, prior.P, z, H, R, weights)
        if np.linalg.norm(x - last) <= 1e-6 * np.linalg.norm(last):
            break
        last, weights = x, np.maximum(weight(residual), 1e-8)
        if sides == "measurement":
            weights[:n] = 1.0
    return x, *covariances


def huber(prior, z, H, R, rows, sides="both"):
    """The method of Karlgaard (2015)."""
    _, P, R = reweighted(prior, z, H, R, lambda r: 1.0 / np.maximum(np.abs(r) / 1.345, 1.0), sides)
    return update(prior.x, P, z, H, R)


def correntropy(prior, z, H, R, rows, sides="both", start="prediction", sigma=5.0):
    """The method of Chen (2017): the gain from the weighted covariances, the covariance from the nominal ones."""
    _, P, Rw = reweighted(prior, z, H, R, lambda r: np.exp(-(r**2) / (2.0 * sigma**2)), sides, start)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + Rw)
    rest = np.eye(len(prior.x)) - K @ H
    return prior.x + K @ (z - H @ prior.x), rest @ prior.P @ rest.T + K @ R @ K.T


SIMILARITY = {
    "log": lambda d, g: (5.0 + d) / (5.0 + g),
    "sqrt": lambda d, g: np.sqrt((5.0 + d) / (5.0 + g)),
    "exp": lambda d, g: np.exp((d - g) / 200.0),  # sigma = 10: with 5 one bit of z moves the result by 4e-9 m
}


def squares(prior, x, P, z, H):
    """Return D_x and D_z."""
    d, e = x - prior.x, z - H @ x
    return P + np.outer(d, d), H @ P @ H.T + np.outer(e, e)


def similarity(prior, z, H, R, rows, sides="both", function="log"):
    """The method of Huang (2021)."""
    n, m, w, xi, weight, last = len(prior.x), len(z), SIMILARITY[function], 1.0, 1.0, prior.x
    for _ in range(50):
        x, P = update(prior.x, prior.P / xi, z, H, R / weight)
        if np.linalg.norm(x - last) <= 1e-6 * np.linalg.norm(x):
            break
        last = x
        D_x, D_z = squares(prior, x, P, z, H)
        xi = max(w(n, np.trace(D_x @ np.linalg.inv(prior.P))), 1e-8) if sides == "both" else 1.0
        weight = max(w(m, np.trace(D_z @ np.linalg.inv(R))), 1e-8)
    return x, P


def student_t(prior, z, H, R, rows, sides="both"):
    """The method of Huang (2017)."""
    n, m, x, P, E, xi = len(prior.x), len(z), prior.x, prior.P, prior.P, 1.0
    for _ in range(10):
        D_x, D_z = squares(prior, x, P, z, H)
        if sides == "both":
            xi = (5.0 + n) / (5.0 + np.trace(D_x @ np.linalg.inv(E)))
            E = (5.0 * prior.P + xi * D_x) / 6.0
        weight = (5.0 + m) / (5.0 + np.trace(D_z @ np.linalg.inv(R)))
        x, P = update(prior.x, E / xi, z, H, R / weight)
    return x, P


class VariationalPriorAndNoise:
    """The method of Huang (2018), with u and U for each set of rows."""

    def __init__(self):
        self.known = {}

    def __call__(self, prior, z, H, R, rows):
        n, m, rho, tau = len(prior.x), len(z), 1.0 - np.exp(-4.0), 3.0
        u, U = self.known.get(tuple(rows), (m + 1 + 3.0, 3.0 * R))
        u, U = rho * (u - m - 1) + m + 1, rho * U
        t, T, x, P = n + tau + 1, tau * prior.P, prior.x, prior.P
        for _ in range(10):
            A, B = squares(prior, x, P, z, H)
            t2, T2, u2, U2 = t + 1, A + T, u + 1, B + U
            x, P = update(prior.x, T2 / (t2 - n - 1), z, H, U2 / (u2 - m - 1))
        self.known[tuple(rows)] = u2, U2
        return x, P


def sliding_innovation(prior, z, H, R, rows, width=10.0):
    """The method of Gadsden (2020), with an explicit pseudo-inverse."""
    y = z - H @ prior.x
    K = np.linalg.pinv(H) @ np.diag(np.minimum(1.0, np.abs(y) / (width * np.sqrt(np.diag(R)))))
    rest = np.eye(len(prior.x)) - K @ H
    return prior.x + K @ y, rest @ prior.P @ rest.T + K @ R @ K.T


class StrongTracking:
    """The method of Zhou (1996), with a weight alpha for each state."""

    def __init__(self, alpha=None, rho=0.95, beta=1.0):
        self.alpha, self.rho, self.beta, self.v = alpha, rho, beta, {}

    def __call__(self, prior, z, H, R, rows):
        n, y = len(prior.x), z - H @ prior.x
        M, alpha = prior.F @ prior.before @ prior.F.T, np.ones(n) if self.alpha is None else self.alpha
        for row, square in zip(rows, y**2, strict=True):
            self.v[row] = (self.rho * self.v[row] + square) / (1 + self.rho) if row in self.v else square
        N = np.diag([self.v[row] for row in rows]) - self.beta * np.diag(np.diag(R)) - H @ prior.Q @ H.T
        c = np.trace(N) / np.trace(np.diag(alpha) @ M @ H.T @ H)
        L = np.diag(np.sqrt(np.maximum(1.0, alpha * c)))
        return update(prior.x, L @ M @ L + prior.Q, z, H, R)


class SageHusaBoth:
    """The diagonals of R and Q with separate counters; Q is a factor on the Q of the model."""

    def __init__(self):
        self.r, self.k, self.g, self.updates = np.zeros(6), np.zeros(6, int), None, 0

    def __call__(self, prior, z, H, R, rows):
        y, b = z - H @ prior.x, 0.97
        M = prior.F @ prior.before @ prior.F.T
        self.g = np.ones(len(prior.x)) if self.g is None else self.g
        P = M + np.diag(np.sqrt(self.g)) @ prior.Q @ np.diag(np.sqrt(self.g))
        for i, row in enumerate(rows):
            d = (1 - b) / (1 - b ** (self.k[row] + 1))
            new = (1 - d) * self.r[row] + d * (y[i] ** 2 - (H @ P @ H.T)[i, i])
            self.r[row] = np.clip(new, 0.1 * R[i, i], 1e4 * R[i, i]) if self.k[row] else R[i, i]
            self.k[row] += 1
        x, posterior = update(prior.x, P, z, H, np.diag(self.r[rows]))
        if self.updates:
            d = (1 - b) / (1 - b ** (self.updates + 1))
            Q = np.outer(x - prior.x, x - prior.x) + posterior - M
            self.g = np.clip((1 - d) * self.g + d * np.diag(Q) / np.diag(prior.Q), 0.1, 100.0)
        self.updates += 1
        return x, posterior
