"""The errors of a resampled max-t over so few families, beside Bonferroni: simulated audits of equal methods.

python experiments/audit/max_t.py [--audits 400]

Normal differences of 108 methods over 14 families, with a correlation between methods; the critical value is the 95 %
point of max |t| of normal families with the correlations that the 14 show.
"""

import argparse

import numpy as np
from scipy.stats import t as student

FAMILIES, METHODS, DRAWS = 14, 108, 1000
LEVEL = 0.05


def largest_t(values: np.ndarray) -> np.ndarray:
    """Return the largest |t| over methods of (..., families, methods)."""
    t = values.mean(axis=-2) / (values.std(axis=-2, ddof=1) / np.sqrt(FAMILIES))
    return np.abs(t).max(axis=-1)


def resampled_bound(values: np.ndarray, rng: np.random.Generator) -> float:
    """Return the critical value for (families, methods)."""
    scaled = (values - values.mean(axis=0)) / values.std(axis=0, ddof=1)
    draws = [largest_t(rng.standard_normal((100, FAMILIES, FAMILIES)) @ scaled) for _ in range(DRAWS // 100)]
    return float(np.quantile(np.concatenate(draws), 1 - LEVEL))


def main() -> None:
    """Print the share of audits with a false verdict, and the critical values."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--audits", type=int, default=400, help="how many for each correlation (default 400)")
    audits, rng = parser.parse_args().audits, np.random.default_rng(1)
    bonferroni = student.ppf(1 - LEVEL / 2 / METHODS, FAMILIES - 1)
    for rho in (0.0, 0.3, 0.6, 0.9):
        common = np.sqrt(rho) * rng.standard_normal((audits, FAMILIES, 1))
        every = common + np.sqrt(1 - rho) * rng.standard_normal((audits, FAMILIES, METHODS))
        bounds = np.array([resampled_bound(values, rng) for values in every])
        largest = largest_t(every)
        print(
            f"correlation {rho}: max-t {100 * (largest > bounds).mean():.1f} % wrong, {bounds.mean():.2f};"
            f" Bonferroni {100 * (largest > bonferroni).mean():.1f} %, {bonferroni:.2f}"
        )


if __name__ == "__main__":
    main()
