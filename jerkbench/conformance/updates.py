"""Updates to try an adaptation on."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.random_streams import stream

ROWS = ((0, 1, 2, 3, 4, 5), (0, 1, 2), (3, 4, 5), (4,), (2,), (0, 1, 4))
"""Rows that may be there."""

SCALES = ((1.0, 1.0), (1.0, 1e-6), (1e-4, 1e12), (1e6, 1e-6))
"""Of H P- H' and of R: ordinary, a tiny R, an R that is all but infinite, a prior that knows nothing."""

STATES = 9
"""Of the filter: three quantities on three axes."""

SIGMAS = (0.0, 1.0, 1.0, 100.0)
"""Size of the innovation in standard deviations; the last is an outlier."""


class Update(NamedTuple):
    """The input of `adapt` in one update, besides its memory."""

    innovation: FloatArray
    HPHt: FloatArray
    R: FloatArray
    rows: IntArray


class Prior(NamedTuple):
    """The state before an update, as `adapt_prior` sees it."""

    x: FloatArray
    P: FloatArray
    F: FloatArray
    Q: FloatArray


def every_kind() -> Iterator[tuple[Update, Prior]]:
    """Updates with rows that come and go, outliers, a tiny and a huge R; in the end many of one kind."""
    random = stream(0, "conformance", "adaptation")
    for scales in SCALES:
        for sigma in SIGMAS:
            for rows in ROWS:
                yield _update(random, rows, scales, sigma)
    for _ in range(40):  # long enough for every window and every counter
        yield _update(random, ROWS[0], SCALES[0], 100.0)


def ordinary(random: np.random.Generator, rows: tuple[int, ...], sigma: float) -> tuple[Update, Prior]:
    """An update whose prior and R are of the same size, off by ``sigma`` standard deviations."""
    return _update(random, rows, SCALES[0], sigma)


def _update(
    random: np.random.Generator, rows: tuple[int, ...], scales: tuple[float, float], sigma: float
) -> tuple[Update, Prior]:
    m, measured = len(rows), np.array(rows)
    prior = _prior(random, scales[0])
    half = random.normal(size=(m, 2 * m)) / np.sqrt(2 * m)
    HPHt, R = prior.P[np.ix_(measured, measured)], scales[1] * half @ half.T
    innovation = sigma * np.sqrt(np.diag(HPHt + R)) * random.choice([-1.0, 1.0], size=m)
    return Update(innovation, HPHt, 0.5 * (R + R.T), measured), prior


def _prior(random: np.random.Generator, scale: float) -> Prior:
    """A step of a second from a full covariance."""
    half, noise = random.normal(size=(2, STATES, 2 * STATES)) / np.sqrt(2 * STATES)
    F = np.eye(STATES) + 0.1 * np.eye(STATES, k=3)
    Q = 0.1 * scale * noise @ noise.T
    P = scale * F @ half @ half.T @ F.T + Q
    return Prior(random.normal(size=STATES), 0.5 * (P + P.T), F, 0.5 * (Q + Q.T))
