"""Independent implementations of adaptations, and sequences of innovations."""

import numpy as np
from scipy.linalg import block_diag, sqrtm
from scipy.stats import chi2

BLOCKS = (slice(0, 3), slice(3, 6))
FORGETTING = 1 - np.exp(-4)


class Update:
    """One update. Absent rows are filled with 0 in y and h, and with 1 in R."""

    def __init__(self, y, HPHt, R, rows):
        self.there = np.isin(np.arange(6), rows)
        self.y, self.HPHt, self.R = np.zeros(6), np.zeros((6, 6)), np.eye(6)
        self.y[rows] = y
        self.HPHt[np.ix_(rows, rows)], self.R[np.ix_(rows, rows)] = HPHt, R
        self.m, self.S = len(rows), self.HPHt + self.R
        self.h, self.r = np.diag(self.HPHt) * self.there, np.diag(self.R) * self.there

    def of(self, block):
        """Return the three sums of a block, and the number of its present rows."""
        return (self.y[block] ** 2).sum(), self.h[block].sum(), self.r[block].sum(), self.there[block].sum()

    def nis(self, block=slice(0, 6)):
        return self.y[block] @ np.linalg.inv(self.S[block, block]) @ self.y[block]


class Histories:
    """The squared innovations of each row, in the order of time."""

    def __init__(self):
        self.of = [[] for _ in range(6)]

    def mean(self, u, length):
        for i in np.flatnonzero(u.there):
            self.of[i].append(u.y[i] ** 2)
        return np.array([np.mean(values[-length:] or [0.0]) for values in self.of])


class NaiveMtf:
    def __init__(self, test, window=1, guard=0):
        self.test, self.window, self.guard, self.past, self.hits = test, window, guard, Histories(), np.zeros(6)

    def __call__(self, u):
        excess = self.past.mean(u, self.window) - u.h - u.r
        hit = self.test(u) & (excess > 0) & u.there
        self.hits = np.where(u.there, np.where(hit, self.hits + 1, 0), self.hits)
        allowed = hit if self.guard == 0 else hit & (self.hits <= self.guard)
        return u.R + np.diag(np.where(allowed, excess, 0.0))


def total_test(u):
    return np.full(6, (u.y**2).sum() >= u.h.sum() + u.r.sum())


def block_test(u):
    return np.repeat([u.of(b)[0] >= u.of(b)[1] + u.of(b)[2] for b in BLOCKS], 3)


def nis_test(u):
    return np.full(6, u.nis() >= chi2.ppf(0.99, u.m))


class NaiveIae:
    def __init__(self, window=10):
        self.window, self.past = window, Histories()

    def __call__(self, u):
        w = self.past.mean(u, self.window)
        full = np.array([len(values) >= self.window for values in self.past.of]) & u.there
        unfilled = np.where(full, 0.0, 1.0)
        R = u.R * np.outer(unfilled, unfilled)
        return R + np.diag(np.where(full, np.maximum(w - u.h, 0.1 * u.r), 0.0))


def naive_federated(beta):
    def adapted(u):
        factors = []
        for block, share in zip(BLOCKS, (beta, 1 - beta), strict=True):
            energy, h, r, n = u.of(block)
            factors.append((energy - h / share) / r if n and energy >= h / share + r else 1.0)
        root = block_diag(*(np.sqrt(f) * np.eye(3) for f in factors))
        return root @ u.R @ root

    return adapted


class NaiveFuzzy:
    def __init__(self):
        self.rho = 1.0

    def __call__(self, u):
        self.rho = 0.5 * self.rho + 0.5 * (u.y**2).sum() / (u.h.sum() + u.r.sum())
        small, large = np.clip(2 - self.rho, 0, 1), np.clip((self.rho - 2) / 4, 0, 1)
        return u.R * (small + 4 * (1 - small - large) + 25 * large)


class NaiveChi2:
    def __init__(self, probability=0.99, longest=25):
        self.probability, self.longest, self.rejected = probability, longest, [0, 0]

    def __call__(self, u):
        R = u.R.copy()
        for k, block in enumerate(BLOCKS):
            n = u.of(block)[3]
            if n == 0:
                continue
            if u.nis(block) > chi2.ppf(self.probability, n) and self.rejected[k] < self.longest:
                self.rejected[k] += 1
                dropped = np.zeros(6)
                dropped[block] = np.inf
                R[np.diag_indices(6)] = np.where(u.there & np.isinf(dropped), np.inf, np.diag(R))
            else:
                self.rejected[k] = 0
        return R


def naive_huber(u):
    sigmas = np.abs(u.y) / np.sqrt(np.diag(u.S)) / 1.345
    return u.R + np.diag(np.where(sigmas > 1, (sigmas - 1) * u.r, 0.0))


def naive_igg3(u):
    """The weight as a piecewise function of v; its inverse inflates R."""
    v = np.abs(u.y) / np.sqrt(np.diag(u.S))
    middle = (2 / np.maximum(v, 1e-300)) * ((6 - v) / (6 - 2)) ** 2
    weight = np.select([v <= 2, v < 6], [1.0, middle], 0.0)
    with np.errstate(divide="ignore"):
        R, variances = u.R.copy(), np.diag(u.R) / weight
    R[np.diag_indices(6)] = np.where(u.there, variances, np.diag(u.R))
    return R


class NaiveRelaxingGate:
    """The memory contains the width and not the number of rejections."""

    def __init__(self, width=3.0, patience=5):
        self.streak, self.width = np.zeros(6, int), np.full(6, width)
        self.narrow, self.patience = width, patience

    def __call__(self, u):
        R = u.R.copy()
        for i in np.flatnonzero(u.there):
            if u.y[i] ** 2 > self.width[i] ** 2 * u.S[i, i]:
                self.streak[i] += 1
                if self.streak[i] > self.patience:
                    self.width[i] *= 1.5
                R[i, i] = np.inf
            else:
                self.streak[i], self.width[i] = 0, self.narrow
        return R


def naive_student_t(u):
    return u.R / ((4 + u.m) / (4 + u.nis()))


class NaiveVariationalBayes:
    """H P+ H' and the residual are computed with the information form of the posterior."""

    def __init__(self, forgetting=FORGETTING):
        self.forgetting, self.alpha, self.beta = forgetting, np.zeros(6), np.zeros(6)

    def __call__(self, u):
        new = u.there & (self.alpha == 0)
        self.alpha[new], self.beta[new] = 3.0, 3.0 * u.r[new]
        rows, rho = np.flatnonzero(u.there), self.forgetting
        alpha, prior_beta = rho * self.alpha[rows] + 0.5, rho * self.beta[rows]
        HPHt, y, beta = u.HPHt[np.ix_(rows, rows)], u.y[rows], prior_beta
        for _ in range(2):
            r = beta / alpha
            posterior = np.linalg.inv(np.linalg.inv(HPHt) + np.diag(1 / r))
            residual = y - posterior @ np.diag(1 / r) @ y
            beta = prior_beta + 0.5 * (residual**2 + np.diag(posterior))
        self.alpha[rows], self.beta[rows] = alpha, beta
        R = np.eye(6)
        R[rows, rows] = r
        return R


def posterior_residual(u, R):
    """z - H x+ of an update with R and H = I, where x+ = (P^-1 + R^-1)^-1 R^-1 y on the present rows."""
    rows = np.flatnonzero(u.there)
    at = np.ix_(rows, rows)
    information = np.linalg.inv(R[at])
    P = np.linalg.inv(np.linalg.inv(u.HPHt[at]) + information)
    residual = np.zeros(6)
    residual[rows] = u.y[rows] - P @ information @ u.y[rows]
    covariance = np.zeros((6, 6))
    covariance[at] = P
    return residual, covariance


def naive_similarity(u):
    weight, root = 1.0, np.linalg.inv(sqrtm(u.R).real)
    for _ in range(10):
        residual, P = posterior_residual(u, u.R / weight)
        B = np.outer(residual, residual) + P
        weight = np.sqrt((3 + u.m) / (3 + np.trace(root @ B @ root)))
    return u.R / weight


def naive_scalar_q(u, limit=1e3):
    energy, h, r = (u.y**2).sum(), u.h.sum(), u.r.sum()
    return min((energy - r) / h, limit) if energy >= h + r else 1.0


class NaiveAdaptiveQ:
    def __init__(self, window):
        self.window, self.past = window, Histories()

    def __call__(self, u):
        w = self.past.mean(u, self.window)
        if min(len(self.past.of[i]) for i in np.flatnonzero(u.there)) < self.window:
            return 1.0
        alpha = np.where(u.there, w - u.r, 0.0).sum() / u.h.sum()
        return float(np.clip(np.sqrt(max(alpha, 0.0)), 1.0, 100.0))


ROWS = ([0, 1, 2, 3, 4, 5], [0, 1, 2], [3, 4, 5], [2], [0, 2, 4])


def sequence(seed, length=80, largest=60.0):
    """Return (innovation, HPHt, R, rows) of each update, with full matrices HPH' and R."""
    rng = np.random.default_rng(seed)
    for k in range(length):
        rows = np.array(ROWS[0] if k < 15 else ROWS[rng.integers(len(ROWS))])
        m = len(rows)
        half = rng.normal(size=(2, m, 2 * m))
        HPHt, R = half @ half.transpose(0, 2, 1) * 10.0 ** rng.uniform(-3, 1, size=(2, 1, 1))
        scale = (0.3, 1.0, 5.0, largest)[rng.integers(4)] if k % 40 < 30 else 8.0  # sometimes consecutive outliers
        innovation = scale * np.linalg.cholesky(HPHt + R) @ rng.normal(size=m)
        yield innovation, HPHt, R, rows


def diagonal_sequence(seed, length=80, largest=60.0):
    """Return a sequence with a diagonal R."""
    for innovation, HPHt, R, rows in sequence(seed, length, largest):
        yield innovation, HPHt, np.diag(np.diag(R)), rows
