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


def median_p(d: FloatArray) -> float:
    """Return the two-sided p that the median of (n,) is 0: the sign test in which a tie counts for either side.

    It is the one that the interval of order statistics inverts.
    """
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min((d <= 0).sum(), (d >= 0).sum()), len(d), 0.5)))
