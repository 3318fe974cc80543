"""The lag at which two streams fit best, and its accuracy."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray

LARGEST_S = 3.0
STEP_S = 0.02
"""The lags that are tried: every step from -largest to largest; between them a parabola."""

PART = 0.1
"""Of a short recording no larger part is tried as a lag: little would be left to compare."""

LEAST_ROWS = 20
LEAST_CORRELATION = 0.5
"""With fewer rows, or a weaker relation at the best lag, none is stated."""

ROWS_OF_A_DRAW = 10
"""So many rows are worth one of a white residual: what is left at the best lag follows itself."""

LIKELY = 3.84
"""Chi-square of one degree of freedom, 95 %."""

WORST_S = 0.1
"""A lag of which no more than this is known is none."""


@dataclass(frozen=True)
class Peak:
    """The largest correlation, and its lag.

    Attributes:
        lag_s: there, refined by a parabola; NaN where it cannot be told.
        correlation: there; NaN where there are too few rows.
        within_s: half the width of the lags that fit hardly worse (95 %).
        edge_s: the largest or smallest lag that was tried, where the correlation is largest at it; else NaN.
        best_s: the refined lag also where too little is known of it for a `lag_s`.
    """

    lag_s: float = float("nan")
    correlation: float = float("nan")
    within_s: float = float("nan")
    edge_s: float = float("nan")
    best_s: float = float("nan")


def largest_lag_s(duration_s: float) -> float:
    """Return the largest lag that is tried in a recording of so long."""
    return float(np.clip(PART * duration_s, 0.6, LARGEST_S))


def best_lag(correlation: Callable[[float], float], rows: int, largest_s: float) -> Peak:
    """Return where ``correlation`` of a lag [s], over ``rows``, is largest up to ``largest_s``.

    A lag tau fits hardly worse than the best where (n/10) ln((1 - r(tau)^2)/(1 - r(best)^2)) < 3.84, r of n rows.
    """
    if rows < LEAST_ROWS:
        return Peak()
    steps = round(largest_s / STEP_S)
    lags_s = np.asarray(np.arange(-steps, steps + 1) * STEP_S, dtype=np.float64)
    values = np.array([correlation(lag_s) for lag_s in lags_s])
    best = int(np.argmax(values))
    peak, within_s = float(values[best]), within(lags_s, values, rows)
    if best in (0, len(values) - 1):
        edge_s = float(lags_s[best]) if peak >= LEAST_CORRELATION else float("nan")
        return Peak(correlation=peak, within_s=within_s, edge_s=edge_s)
    best_s = refined(lags_s, values)
    told = peak >= LEAST_CORRELATION and within_s <= WORST_S
    return Peak(best_s if told else float("nan"), peak, within_s, best_s=best_s)


def refined(lags_s: FloatArray, values: FloatArray) -> float:
    """Return the top of the parabola through the best of evenly spaced lags and its neighbours, all of them inside."""
    best = int(np.argmax(values))
    before, peak, after = values[best - 1 : best + 2]
    bend = before - 2 * peak + after
    offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(lags_s[best] + offset * (lags_s[1] - lags_s[0]))


def correlation_of(a: FloatArray, b: FloatArray) -> float:
    """Return that of all columns of (n, k) or (n,) together, each less its mean; 0 where one does not change."""
    a, b = a.reshape(len(b), -1) - a.reshape(len(b), -1).mean(axis=0), b.reshape(len(b), -1) - b.mean(axis=0)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0 else 0.0


def within(lags_s: FloatArray, values: FloatArray, rows: int) -> float:
    """Return half the width of the lags that fit hardly worse than the best; at least half a step."""
    misfit = np.maximum(1.0 - values**2, 1e-12)
    likely = np.log(misfit / misfit[int(np.argmax(values))]) < LIKELY * ROWS_OF_A_DRAW / rows
    likely &= values > 0
    return float(0.5 * (np.ptp(lags_s[likely]) + lags_s[1] - lags_s[0])) if likely.any() else float(lags_s[-1])
