"""Error rate of the statistics of an audit if all methods are equal: `python benchmarks/drives_and_tunings.py`.

The simulated log errors of 108 methods, 16 tunings and 600 drives have the standard deviations of a pilot audit: 0.46
between drives (skewed distribution), 0.05 between tunings (median over the methods; above 0.16 for a tenth of the
methods), and 0.2 for the residual.
"""

import argparse

import numpy as np
from scipy import stats

from jerkbench.evaluation.drives_and_tunings import Losses, comparisons, procedure_error, statements
from jerkbench.evaluation.judgement import LEVEL

METHODS, PLAINS, TUNINGS, DRIVES = 108, 4, 16, 600


def null_audit(random: np.random.Generator, *, skewed: bool) -> Losses:
    """Return a simulated audit in which no method differs from any plain filter."""

    def drawn(count: int, luck: object) -> np.ndarray:
        shape = (count, TUNINGS, 1)
        tuning = random.exponential(size=shape) - 1.0 if skewed else random.standard_normal(shape)
        drive = 0.46 * (random.exponential(size=(count, 1, DRIVES)) - 1.0)
        rest = 0.2 * random.standard_normal((count, TUNINGS, DRIVES))
        return tuning * np.reshape(luck, (-1, 1, 1)) + drive + rest

    luck = 0.05 * np.exp(0.9 * random.standard_normal(METHODS))
    judged = [drawn(METHODS, luck), drawn(PLAINS, 0.05), drawn(PLAINS, 0.05)]
    tuned = [random.standard_normal((count, TUNINGS)) for count in (METHODS, PLAINS, PLAINS)]
    chosen = np.arange(METHODS) < 88
    return Losses(*judged, *tuned, np.arange(METHODS) % PLAINS, chosen, chosen)


def says_something(losses: Losses) -> bool:
    """Return True if any verdict is "better" or "worse"."""
    said = statements(losses)
    each = (said.average, said.pick, *said.same_model_plain, *said.best_plain)
    return any(one.verdict in ("better", "worse") for one in each)


def drives_alone_say_something(losses: Losses) -> bool:
    """Return True if Student's t test over the drives, which ignores the tunings, finds any difference."""
    p = [stats.ttest_1samp(y.mean(axis=1), 0.0, axis=1).pvalue for y in comparisons(losses)[2:]]
    return bool(np.min(p) < LEVEL / 3 / (2 * METHODS))


def main() -> None:
    """Print the number of audits with a false verdict."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--audits", type=int, default=300)
    parser.add_argument(
        "--resampled", type=int, default=300, help="number of audits that are resampled from the first audit"
    )
    chosen = parser.parse_args()
    for skewed in (False, True):
        random = np.random.default_rng(int(skewed))
        first = null_audit(random, skewed=skewed)
        wrong = alone = 0
        for number in range(chosen.audits):
            losses = null_audit(random, skewed=skewed) if number else first
            wrong += says_something(losses)
            alone += drives_alone_say_something(losses)
        print(f"search results {'skewed' if skewed else 'normal'}: false verdict in {wrong} of {chosen.audits} audits,")
        print(f"  with only the drives random in {alone};", procedure_error(first, chosen.resampled), flush=True)


if __name__ == "__main__":
    main()
