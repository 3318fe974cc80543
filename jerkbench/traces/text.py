"""A trace in a few words."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.traces.trace import Trace

LAGS_S = (1.0, 10.0)
GAP = 1.5
"""A step of more than so many usual intervals is a gap."""


def trace_text(trace: Trace) -> str:
    """Return rows, rate, gaps, size and correlation of the errors."""
    steps = np.diff(trace.t_s)
    gaps = steps[steps > GAP * trace.interval_s]
    level = np.hypot(trace.error_m[:, 0], trace.error_m[:, 1])
    nees = np.einsum("mi,mij,mj->m", trace.error_m, np.linalg.inv(trace.covariance_m2), trace.error_m)
    correlation = ", ".join(f"{value:.2f}" for value in (autocorrelation(trace, lag)[:2].mean() for lag in LAGS_S))
    return (
        f"errors of {len(trace.t_s)} fixes of {trace.about.recording} against {trace.about.reference}\n"
        f"{1 / trace.interval_s:.3g} Hz over {trace.period_s:.0f} s; {len(gaps)} gaps, the longest"
        f" {gaps.max(initial=0.0):.1f} s\n"
        f"horizontal error rms {np.sqrt(np.mean(level**2)):.3g} m, 95 % {np.quantile(level, 0.95):.3g} m, largest"
        f" {level.max():.3g} m; median taken off: {', '.join(f'{x:.3f}' for x in trace.about.offset_m)} m\n"
        f"NEES (3 expected): median {np.median(nees):.3g}, mean {nees.mean():.3g}; horizontal autocorrelation at 1 s"
        f" and 10 s: {correlation}"
    )


def autocorrelation(trace: Trace, lag_s: float) -> FloatArray:
    """Return (3,) of the errors about their mean, over all pairs of fixes that are ``lag_s`` apart."""
    error = trace.error_m - trace.error_m.mean(axis=0)
    later = np.searchsorted(trace.t_s, trace.t_s + lag_s - 0.25 * trace.interval_s)
    paired = later < len(trace.t_s)
    paired[paired] &= np.abs(trace.t_s[later[paired]] - trace.t_s[paired] - lag_s) < 0.5 * trace.interval_s
    products = error[paired] * error[later[paired]]
    variance = np.mean(error**2, axis=0)
    moving = (variance > 0) & paired.any()  # a trace of the plane has no errors of up
    return np.where(moving, products.sum(axis=0) / max(paired.sum(), 1) / np.where(moving, variance, 1.0), np.nan)
