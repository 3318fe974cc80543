"""Exact tests of counts and medians: they hold whatever the distribution is, lost runs included."""

from jerkbench.arrays import FloatArray


def sign_p(for_a: int, for_b: int) -> float:
    """Return the two-sided p of so many seeds for either, ties left out: the exact binomial test of one half.

    Of seeds that either lost alone it is McNemar's exact test.

    Source: McNemar, "Note on the sampling error of the difference between correlated proportions", Psychometrika 12
    (1947).
    """
    from scipy.special import bdtr

    fewer, total = min(for_a, for_b), for_a + for_b
    return min(1.0, 2.0 * float(bdtr(fewer, total, 0.5))) if total else 1.0


def equal_median_p(d: FloatArray, margin: float) -> float:
    """Return the p of the claim that the median of (n,) lies within -+margin: the larger of two exact sign tests."""
    from scipy.special import bdtr

    beyond = max(int((d >= margin).sum()), int((d <= -margin).sum()))
    return float(bdtr(beyond, len(d), 0.5)) if len(d) else 1.0


def rare_p(count: int, n: int, share: float) -> float:
    """Return the p of the claim that less than ``share`` of runs fail, ``count`` of n having: the binomial test."""
    from scipy.special import bdtr

    return float(bdtr(count, n, share)) if n else 1.0
