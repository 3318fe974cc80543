"""The interval of a share: of runs that were lost, of seeds that one method won; and what losses were not seen."""

from functools import lru_cache
from math import ceil, inf, log, log1p

ONE_SIDED = 0.95
"""The share of lost runs is surely below its bound: not in 5 % of cases, whatever it is."""


@lru_cache(maxsize=10_000)
def share_interval(count: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return Clopper and Pearson's interval of a share: it covers at least ``confidence``, whatever the share is.

    Source: Clopper and Pearson, "The use of confidence or fiducial limits", Biometrika 26 (1934).
    """
    from scipy.special import betaincinv

    tail = (1 - confidence) / 2
    low = float(betaincinv(count, n - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, n - count, 1 - tail)) if count < n else 1.0
    return low, high


def loss_bound(count: int, n: int) -> float:
    """Return Clopper and Pearson's one-sided 95 % bound of the share of lost runs; of none in n it is 1 - .05^(1/n)."""
    return share_interval(count, n, 2 * ONE_SIDED - 1)[1]


def seeds_without_loss(margin: float) -> float:
    """Return how many seeds without a loss bound its share by ``margin``: 99 for 3 %."""
    return ceil(log(1 - ONE_SIDED) / log1p(-margin)) if 0 < margin < 1 else 1 if margin else inf


def losses_text(count: int, n: int) -> str:
    """Say how many runs were lost, and how many may be.

    >>> losses_text(0, 20)
    '0 of 20 lost (up to 14 %)'
    """
    return f"{count} of {n} lost ({up_to(count, n)})"


def up_to(count: int, n: int) -> str:
    """Return the bound of the share of lost runs in words."""
    percent = 100 * loss_bound(count, n)
    return f"up to {percent:.{0 if percent >= 10 else 1}f} %"
