"""Random sequences of updates: rows come and go, sigmas are right, too large and far too large."""

import numpy as np

ROWS = ([0, 1, 2, 3, 4, 5], [0, 1, 2], [3, 4, 5], [2], [0, 2, 4])


def sequence(seed, length=80, largest=60.0):
    """(innovation, HPHt, R, rows) of each update; HPH' and R are full."""
    rng = np.random.default_rng(seed)
    for k in range(length):
        rows = np.array(ROWS[0] if k < 15 else ROWS[rng.integers(len(ROWS))])
        m = len(rows)
        half = rng.normal(size=(2, m, 2 * m))
        HPHt, R = half @ half.transpose(0, 2, 1) * 10.0 ** rng.uniform(-3, 1, size=(2, 1, 1))
        scale = (0.3, 1.0, 5.0, largest)[rng.integers(4)] if k % 40 < 30 else 8.0  # now and then a row of outliers
        innovation = scale * np.linalg.cholesky(HPHt + R) @ rng.normal(size=m)
        yield innovation, HPHt, R, rows


def diagonal_sequence(seed, length=80, largest=60.0):
    """The same with diagonal R."""
    for innovation, HPHt, R, rows in sequence(seed, length, largest):
        yield innovation, HPHt, np.diag(np.diag(R)), rows
