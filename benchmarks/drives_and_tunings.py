"""How often an audit over drives and tunings errs where nothing differs: `python benchmarks/drives_and_tunings.py`.

Log errors are drawn as the pilot of the audit found them: 108 methods, 16 tunings, 600 drives; between drives a skewed
.46, between tunings .05 (median over methods; a tenth of them above .16), the rest .2.
"""

import argparse

import numpy as np
from scipy import stats

from jerkbench.evaluation.drives_and_tunings import Losses, comparisons, procedure_error, statements
from jerkbench.evaluation.judgement import LEVEL

METHODS, PLAINS, TUNINGS, DRIVES = 108, 4, 16, 600


def null_audit(random: np.random.Generator, *, skewed: bool) -> Losses:
    """Draw an audit in which no method differs from any plain filter."""

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
    """Whether any statement is "better" or "worse"."""
    said = statements(losses)
    each = (said.average, said.pick, *said.same_model_plain, *said.best_plain)
    return any(one.verdict in ("better", "worse") for one in each)


def drives_alone_say_something(losses: Losses) -> bool:
    """The same of Student's t over the drives, as if one tuning were all there is."""
    p = [stats.ttest_1samp(y.mean(axis=1), 0.0, axis=1).pvalue for y in comparisons(losses)[2:]]
    return bool(np.min(p) < LEVEL / 3 / (2 * METHODS))


def main() -> None:
    """Print how many audits err."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--audits", type=int, default=300)
    parser.add_argument("--resampled", type=int, default=300, help="of the first audit's rows")
    chosen = parser.parse_args()
    for skewed in (False, True):
        random = np.random.default_rng(int(skewed))
        first = null_audit(random, skewed=skewed)
        wrong = alone = 0
        for number in range(chosen.audits):
            losses = null_audit(random, skewed=skewed) if number else first
            wrong += says_something(losses)
            alone += drives_alone_say_something(losses)
        print(f"luck of the search {'skewed' if skewed else 'normal'}: {wrong} of {chosen.audits} audits err,")
        print(f"  by Student's t over the drives {alone};", procedure_error(first, chosen.resampled), flush=True)


if __name__ == "__main__":
    main()
