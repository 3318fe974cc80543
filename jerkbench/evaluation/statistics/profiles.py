"""Many scenarios at once: mean ranks and performance profiles, neither of which needs a common scale."""

import numpy as np

from jerkbench.arrays import FloatArray


def mean_ranks(costs: FloatArray) -> FloatArray:
    """Return (s,) the mean rank of s solvers over the scenarios of (p, s) costs; 1 is the best.

    Equal costs share their ranks; a cost that is not finite (it diverged) is the last of its scenario.
    """
    from scipy.stats import rankdata

    filled = np.where(np.isfinite(costs), costs, np.inf)
    ranks: FloatArray = np.mean([rankdata(row) for row in filled], axis=0)
    return ranks


def performance_profile(costs: FloatArray, factors: FloatArray) -> FloatArray:
    """Return (s, f) the share of scenarios in which a solver costs at most ``factors`` (f,) times the best of it.

    ::

        rho_s(tau) = |{p: c_ps <= tau min_s' c_ps'}|/P

    A cost that is not finite never is; a scenario in which none is finite counts against all.

    Source: Dolan and Moré, "Benchmarking optimization software with performance profiles", Math. Prog. 91 (2002).
    """
    filled = np.where(np.isfinite(costs), costs, np.inf)
    best = filled.min(axis=1, keepdims=True)
    near = np.isfinite(filled)[:, :, None] & (
        filled[:, :, None] <= factors * np.where(np.isfinite(best), best, 0.0)[:, :, None]
    )
    shares: FloatArray = near.mean(axis=0)
    return shares
