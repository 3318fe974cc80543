"""Coverage, false verdicts and power of the statistics, in simulations with known truth.

The log errors of three methods over common seeds are the sum of a common effect of the seed (standard deviation 0.3)
and an effect of the method (standard deviation about 0.1) with a distribution of `OWN`. All means are equal, so any
verdict "better" is false. Each table uses a separate stream of random numbers. At the end, the script prints the values
that miss their target by more than two standard errors. The targets are a coverage of 93 to 97 % for the interval of a
cell, false verdicts in at most 5 % of the studies, and a decision in at least 80 % of comparisons with the stated
number of seeds.

``python benchmarks/statistics.py [--studies 150] [--only power]``
"""

import argparse
import itertools
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from jerkbench.evaluation.drives_and_tunings import over_scenarios
from jerkbench.evaluation.intervals import (
    ENOUGH,
    GEOMETRIC,
    MEDIAN,
    SHRUNK,
    Samples,
    centres,
    hall_intervals,
    quantiles_of_rows,
    share_interval,
    student_intervals,
)
from jerkbench.evaluation.judgement import (
    DEFEATS,
    FAILED_MORE,
    MARGIN,
    WINS,
    Judgement,
    LogRatios,
    Verdict,
    judged,
    log_ratios,
)
from jerkbench.evaluation.planning import interim_levels, interim_sizes, seeds_needed

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

SEEDS = (3, 5, 6, 10, 20, 50)
ENOUGH_FOR_EQUAL = (99, 150, 300)
"""Numbers of seeds for the verdict "equal". Fewer seeds cannot exclude that 3 % of the runs fail."""

FAMILY = 10
"""Number of comparisons of a study in the simulation of the required seeds."""

SCENARIOS = (1, 10, 60)
SIGMA, COMMON = 0.1, 0.3
FACTOR = 50.0
SKEW = 0.5
"""Parameter sigma of the lognormal distribution of the log errors. The skewness is 1.75."""

Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]
Interval = Callable[[Array, float], tuple[Array, Array]]


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return the logarithms of normal errors with a standard deviation of a tenth of the mean."""
    z = np.maximum(1 + SIGMA * rng.standard_normal(shape), 0.01)
    return np.log(z)


def lognormal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return the logarithms of lognormal errors."""
    return SIGMA * rng.standard_normal(shape)


def skewed(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return lognormal log errors with mean 0, with opposite skewness for the first and the last method."""
    z = SIGMA * (np.exp(SKEW * rng.standard_normal(shape)) - np.exp(SKEW**2 / 2))
    if len(shape) > 2:
        z[:, 1] = SIGMA * rng.standard_normal(z[:, 1].shape)
        z[:, 2] *= -1
    return z


def t3(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return log errors with Student's t distribution with 3 degrees of freedom."""
    return SIGMA * rng.standard_t(3, shape)


def lock_outs(rng: np.random.Generator, shape: tuple[int, ...], share: float = 0.1) -> Array:
    """Return log errors, with 50 times the error in a random fraction of the runs of each method."""
    return SIGMA * rng.standard_normal(shape) + np.log(FACTOR) * (rng.random(shape) < share)


def lost(rng: np.random.Generator, shape: tuple[int, ...], share: float = 0.1) -> Array:
    """Return log errors, with infinite errors (failed runs) in a random fraction of the runs of each method."""
    return np.where(rng.random(shape) < share, np.inf, SIGMA * rng.standard_normal(shape))


OWN: dict[str, Draw] = {
    "normal": normal,
    "lognormal": lognormal,
    "skewed": skewed,
    "t3": t3,
    "3 % x 50": partial(lock_outs, share=0.03),
    "10 % x 50": lock_outs,
    "3 % failed": partial(lost, share=0.03),
    "10 % failed": lost,
}


def line(*cells: object) -> None:
    """Print a line of a Markdown table."""
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


@dataclass(frozen=True)
class Table:
    """A printed table of fractions, which stores the fractions outside its bounds.

    Attributes:
        title: title of the table.
        first: header of the first column.
        columns: headers of the other columns.
        bounds: target range of the fractions [%].
        outside: descriptions of the fractions that miss the target by more than two standard errors.
    """

    title: str
    first: str
    columns: Sequence[object]
    bounds: tuple[float, float] = (0.0, 100.0)
    outside: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Print the title and the header."""
        print(f"\n## {self.title}\n")
        line(self.first, *self.columns)
        line(*["---"] * (1 + len(self.columns)))

    def add(self, name: str, hits: Iterable[Sequence[bool]]) -> None:
        """Print a row with the fraction of ``hits`` in each column."""
        shares = [_Share(np.asarray(of, dtype=float)) for of in hits]
        line(name, *shares)
        low, high = self.bounds
        for column, share in zip(self.columns, shares, strict=True):
            away = max(low - share.percent, share.percent - high)
            if away > 2 * share.error:
                errors = f"{away:.1f} outside {low:g} to {high:g}, {away / share.error:.1f} standard errors"
                self.outside.append(f"{self.title} {name}; {column}: {share} ({errors})")


@dataclass(frozen=True, eq=False)
class _Share:
    hits: Array

    @property
    def percent(self) -> float:
        """The fraction in percent. NaN without any cases, which is never outside the bounds."""
        return float(100 * self.hits.mean()) if len(self.hits) else np.nan

    @property
    def error(self) -> float:
        """The standard error in percent, with one additional hit and one additional miss."""
        n = len(self.hits) + 2
        share = (self.hits.sum() + 1) / n
        return float(100 * np.sqrt(share * (1 - share) / n))

    def __str__(self) -> str:
        return f"{self.percent:.1f}" if len(self.hits) else "-"


COVERED, FALSE, POWER = (93.0, 97.0), (0.0, 5.0), (80.0, 100.0)
"""Targets [%]."""


def cells(rng: np.random.Generator, studies: int) -> list[Table]:
    """Coverage of the interval of a cell (median, or geometric mean with few seeds) and of the failure rate."""
    samples = 20 * studies
    table = Table("Coverage of the 95 % interval of a cell [%]", "errors, seeds", SEEDS, COVERED)
    for name, own in OWN.items():
        many = own(np.random.default_rng(1), (4_000_000,))
        truths = float(np.mean(many[np.isfinite(many)])), float(np.median(many))
        drawn = {n: own(rng, (samples, n)) for n in SEEDS}
        table.add(name, [_shown(drawn[n], *truths) for n in SEEDS])
        if name.endswith("failed"):
            share = float(np.mean(np.isinf(many)))
            table.add(f"{name}, failure rate", [_shares(np.isinf(drawn[n]), share) for n in SEEDS])
    return [table]


def _shown(logs: Array, mean: float, median: float) -> list[bool]:
    """Return whether the interval of each cell contains the true median or geometric mean."""
    found = [of for of in centres(Samples.of(list(np.exp(logs)))) if not np.isnan(of.low)]
    truth = {GEOMETRIC: np.exp(mean), MEDIAN: np.exp(median)}
    return [bool(of.low <= truth[of.kind] <= of.high) for of in found]


def _held(low: Array, high: Array, truth: float) -> list[bool]:
    return ((low <= truth) & (truth <= high)).tolist()


def of_few_seeds(rng: np.random.Generator, studies: int) -> list[Table]:
    """Coverage of other intervals of a mean with few seeds."""
    samples, sizes = 100 * studies, [n for n in SEEDS if n <= ENOUGH]
    title = "Coverage of other intervals of a mean [%]; in brackets: mean width / mean width of Student's interval"
    table = Table(title, "interval, errors", sizes)
    for (name, interval), errors in itertools.product(INTERVALS.items(), ("normal", "skewed", "t3")):
        truth = float(np.mean(OWN[errors](np.random.default_rng(1), (4_000_000,))))
        told = [_told(OWN[errors](rng, (samples, n)), truth, interval) for n in sizes]
        line(f"{name}, {errors}", *told)
    return [table]


def _told(values: Array, truth: float, interval: Interval) -> str:
    ends, student = interval(values, 0.95), student_intervals(values, 0.95)
    width = np.mean(ends[1] - ends[0]) / np.mean(student[1] - student[0])
    return f"{100 * np.mean(_held(*ends, truth)):.1f} ({width:.2f})"


def johnson(values: Array, confidence: float) -> tuple[Array, Array]:
    """Return Johnson's modified t interval (JASA 73, 1978): Student's interval, shifted towards the long tail."""
    low, high = student_intervals(values, confidence)
    n, s = values.shape[1], values.std(axis=1, ddof=1)
    third = n / ((n - 1) * (n - 2)) * np.sum((values - values.mean(axis=1, keepdims=True)) ** 3, axis=1)
    return low + third / (6 * n * s**2), high + third / (6 * n * s**2)


def joined(share: float) -> Interval:
    """Return the smallest interval that contains Student's and Hall's interval with a fraction of the skewness."""

    def interval(values: Array, confidence: float) -> tuple[Array, Array]:
        own, other = student_intervals(values, confidence), hall_intervals(values, confidence, share)
        return np.fmin(own[0], other[0]), np.fmax(own[1], other[1])

    return interval


INTERVALS: dict[str, Interval] = {
    "Student": student_intervals,
    "Johnson": johnson,
    "Hall": hall_intervals,
    **{f"combined, {share:g} times the skewness": joined(share) for share in (0.4, SHRUNK, 1.0)},
}


def _shares(failed: Array, share: float) -> list[bool]:
    ends = [share_interval(int(row.sum()), len(row)) for row in failed]
    return [low <= share <= high for low, high in ends]


def study(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int) -> Array:
    """Return (S, 3, n) errors of three equal methods."""
    common = COMMON * rng.standard_normal((scenarios, 1, seeds))
    return np.exp(common + own(rng, (scenarios, 3, seeds)))


def pairs(errors: Array) -> list[LogRatios]:
    """Return the log ratios of every pair of methods in every scenario."""
    return [log_ratios(*pair) for scenario in errors for pair in itertools.combinations(scenario, 2)]


def ratios(rng: np.random.Generator, studies: int) -> list[Table]:
    """Coverage of the intervals of the ratios of a study, and of the interval of a ratio over several scenarios."""
    title = "Studies of three equal methods in which all intervals of ratios contain 1 [%]"
    table = Table(title, "errors, seeds", SEEDS, (95.0, 100.0))
    for name, own in OWN.items():
        table.add(name, [_all_hold(rng, own, n, 5 * studies) for n in SEEDS])
    several = Table(
        "Coverage of the 95 % interval of a ratio over scenarios [%]", "errors, scenarios, seeds", SEEDS, COVERED
    )
    for name, scenarios in itertools.product(("normal", "lognormal", "skewed", "t3"), SCENARIOS[1:]):
        several.add(f"{name}, {scenarios}", [_over(rng, OWN[name], scenarios, n, 12 * studies) for n in SEEDS])
    return [table, several]


def _all_hold(rng: np.random.Generator, own: Draw, seeds: int, studies: int) -> list[bool]:
    made = [judged(pairs(study(rng, own, 1, seeds))) for _ in range(studies)]
    known = [[of for of in one if not np.isnan(of.low)] for one in made]
    return [all(of.low <= 1 <= of.high for of in one) for one in known if one]


def _over(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int, samples: int) -> list[bool]:
    hits = []
    for _ in range(samples // 4):
        truths = 0.1 * rng.standard_normal((scenarios, 1))
        a, b = np.log(study(rng, own, scenarios, seeds)).transpose(1, 0, 2)[:2]
        model = over_scenarios(a - b + truths)
        hits.append(model.low <= 1 <= model.high)
    return hits


def opposite(rng: np.random.Generator, studies: int) -> list[Table]:
    """Compare two centres of a ratio if the errors of two methods are skewed in opposite directions.

    The first centre is the mean of the log ratios, which decides the verdicts. The second centre is their median, with
    its interval by order statistics.
    """
    found = {}
    for skew in (0.5, 0.75, 1.0):
        median = float(np.median(_opposite(rng, skew, (1, 1_000_000))))
        name = f"{(np.exp(skew**2) + 2) * np.sqrt(np.exp(skew**2) - 1):.2g}"
        drawn = (_opposite(rng, skew, (20 * studies, n)) for n in SEEDS[2:])
        found[name] = [[_centres(d, median) for d in of_seeds] for of_seeds in drawn]
    tables = []
    for k, title in enumerate(
        (
            "Coverage of the interval of the mean",
            "Coverage of the interval of the median",
            "Wider interval of the median",
        )
    ):
        tables.append(Table(f"{title} [%]", "skewness of the log errors, seeds", SEEDS[2:]))
        for name, of_seeds in found.items():
            tables[-1].add(name, [[one[k] for one in of] for of in of_seeds])
    return tables


def _opposite(rng: np.random.Generator, skew: float, shape: tuple[int, int]) -> Array:
    """Return log ratios with the mean 0 of two methods whose log errors are lognormal, upwards and downwards."""
    up, down = (np.exp(skew * rng.standard_normal(shape)) - np.exp(skew**2 / 2) for _ in range(2))
    return SIGMA * (up + down)


def _centres(d: Array, median: float) -> tuple[bool, bool, bool]:
    (of_mean,) = _judged(d[None])
    low, high = (float(end[0]) for end in quantiles_of_rows(d[None])[1:3])
    wider = high - low > np.log(of_mean.high / of_mean.low)
    return of_mean.low <= 1 <= of_mean.high, low <= median <= high, wider


def selection(rng: np.random.Generator, studies: int) -> list[Table]:
    """False differences of the first and the last of equal methods, with and without the correction for all pairs."""
    methods = (3, 6, 12, 24)
    title = "Studies of equal methods in which the interval of the ratio of the first to the last method excludes 1 [%]"
    heads = [f"{k} methods" for k in methods]
    drawn = {
        name: [[OWN[name](rng, (5, 20, k)) for _ in range(4 * studies)] for k in methods]
        for name in ("lognormal", "skewed", "t3")
    }
    plain = Table(title + ", uncorrected", "errors", heads)
    for name, of in drawn.items():
        plain.add(name, [[_excludes(logs, 0.05) for logs in fields] for fields in of])
    corrected = Table(title, "errors", heads, FALSE)
    for name, of in drawn.items():
        rates = zip(methods, of, strict=True)
        corrected.add(name, [[_excludes(logs, 0.1 / (k * (k - 1))) for logs in fields] for k, fields in rates])
    return [plain, corrected]


def _excludes(logs: Array, level: float) -> bool:
    order = np.argsort(logs.mean(axis=(0, 1)))
    model = over_scenarios(logs[:, :, order[0]] - logs[:, :, order[-1]], 1 - level)
    return not model.low <= 1 <= model.high


def false_sentences(rng: np.random.Generator, studies: int) -> list[Table]:
    """Studies of equal methods with any verdict other than "equal" and "undecided"."""
    title = "Studies of equal methods with any false verdict [%]"
    table = Table(title, "errors, scenarios, seeds", SEEDS, FALSE)
    for scenarios, (name, own) in itertools.product(SCENARIOS, OWN.items()):
        many = studies if scenarios > 10 else 2 * studies if scenarios > 1 else 5 * studies
        rates = [[_any_false(study(rng, own, scenarios, n)) for _ in range(many)] for n in SEEDS]
        table.add(f"{name}, {scenarios}", rates)
    return [table]


def _any_false(errors: Array) -> bool:
    return any(_differs(judgement) for judgement in judged(pairs(errors)))


def _differs(judgement: Judgement) -> bool:
    """Return True if the verdict states a difference, including a difference within the margin."""
    return judgement.verdict not in {Verdict.UNDECIDED, Verdict.EQUAL}


def whole_studies(rng: np.random.Generator, studies: int) -> list[Table]:
    """Studies with 1200 comparisons, in which half of the methods have four times the error of the others."""
    title = "Ten scenarios with 16 methods, half of which have four times the error [%]"
    sizes = (10, 20, 50)
    heads = [f"{n} seeds" for n in sizes]
    names = ("normal", "t3", "skewed", "10 % x 50")
    seen = {
        name: [[_of_study(_two_levels(rng, OWN[name], n)) for _ in range(max(1, studies // 4))] for n in sizes]
        for name in names
    }
    decided = Table(title + ": decided pairs of different methods", "errors", heads)
    for name, ends in seen.items():
        decided.add(name, [[share for share, _ in of] for of in ends])
    false = Table(title + ": studies with a false verdict for equal methods", "errors", heads, FALSE)
    for name, ends in seen.items():
        false.add(name, [[any_ for _, any_ in of] for of in ends])
    return [decided, false]


def _two_levels(rng: np.random.Generator, own: Draw, seeds: int) -> Array:
    """Return (10, 16, n) errors. The errors of the last eight methods are four times as large."""
    common = COMMON * rng.standard_normal((10, 1, seeds))
    scatter = own(rng, (10, 16, seeds))
    return np.exp(common + scatter / 2 + np.log(4) * (np.arange(16) >= 8)[:, None])


def _of_study(errors: Array) -> tuple[float, bool]:
    """Return the decided fraction of the different pairs, and True if any equal pair has a false verdict."""
    places = list(itertools.combinations(range(16), 2)) * len(errors)
    differ = np.array([a < 8 <= b for a, b in places])
    shown = np.array([_differs(judgement) for judgement in judged(pairs(errors))])
    return float(shown[differ].mean()), bool(shown[~differ].any())


def false_equals(rng: np.random.Generator, studies: int) -> list[Table]:
    """Studies of methods that differ by exactly the margin, so that the verdict "equal" is false."""
    title = 'Studies of methods that differ by the margin with any verdict "equal" [%]'
    table = Table(title, "errors, scenarios, seeds", ENOUGH_FOR_EQUAL, FALSE)
    for scenarios, name in itertools.product(SCENARIOS[:2], ("normal", "lognormal", "skewed", "t3")):
        rates = [[_any_equal(rng, OWN[name], scenarios, n) for _ in range(2 * studies)] for n in ENOUGH_FOR_EQUAL]
        table.add(f"{name}, {scenarios}", rates)
    return [table]


def _any_equal(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int) -> bool:
    d = (own(rng, (3 * scenarios, seeds)) - own(rng, (3 * scenarios, seeds))) / 8 + np.log1p(MARGIN)
    return any(judgement.verdict in {Verdict.EQUAL, Verdict.SMALL} for judgement in _judged(d))


def unseen(rng: np.random.Generator, studies: int) -> list[Table]:
    """Two methods that are equal except for 50 times the error of one method in some runs. "Equal" is false."""
    title = 'Studies with the verdict "equal" if one method has 50 times the error in some runs [%]'
    seeds = (10, 20, 50, 99, 150, 300)
    limits = 1 / (1 + MARGIN), 1 + MARGIN
    made = {
        f"{100 * share:.0f} %": [[_with_lock_outs(rng, share, n) for _ in range(8 * studies)] for n in seeds]
        for share in (0.03, 0.1)
    }
    alone = Table(title + ", without the bound of the failure rate", "fraction of the runs, seeds", seeds)
    for name, of_sizes in made.items():
        alone.add(name, [[limits[0] < of.low and of.high < limits[1] for of in one] for one in of_sizes])
    bounded = Table(title, "fraction of the runs, seeds", seeds, FALSE)
    for name, of_sizes in made.items():
        bounded.add(name, [[of.verdict is Verdict.EQUAL for of in one] for one in of_sizes])
    return [alone, bounded]


def _with_lock_outs(rng: np.random.Generator, share: float, seeds: int) -> Judgement:
    d = MARGIN / 10 * rng.standard_normal(seeds) + np.log(FACTOR) * (rng.random(seeds) < share)
    return _judged(d[None])[0]


def ruined(rng: np.random.Generator, studies: int) -> list[Table]:
    """Two equal methods, except that the error of the second is multiplied by a factor in a fraction of the runs."""
    title = "Comparisons with a method whose error is multiplied by a factor in a fraction of the runs: "
    rows = [(factor, seeds) for factor in (12, 50, 1000) for seeds in (10, 20, 50)]
    shares = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    found = {row: [_with_ruined(rng, share, *row, 2 * studies) for share in shares] for row in rows}

    def counted(words: str, said: Callable[[Judgement], bool], least: int = 0, **bounds: tuple[float, float]) -> Table:
        """Return a table. With ``least``, it contains only rows with at least ``least`` seeds, and fractions >= 0.6."""
        first = 4 if least else 0
        table = Table(title + words, "factor, seeds; fraction of the runs", shares[first:], **bounds)
        for (factor, seeds), of_shares in found.items():
            if seeds >= least:
                table.add(f"{factor}, {seeds}", [[said(one) for one in of] for of in of_shares[first:]])
        return table

    few = (0.0, 5 / 3)
    return [
        counted("this method is better or fails in fewer runs [%]", lambda one: one.verdict in DEFEATS, bounds=few),
        counted(
            "this method has the smaller median error but fails in more runs [%]",
            lambda one: one.reason == FAILED_MORE,
            bounds=few,
        ),
        counted("the other method is better or fails in fewer runs [%]", lambda one: one.verdict in WINS),
        counted(
            "the other method is better or fails in fewer runs, with a target [%]",
            lambda one: one.verdict in WINS,
            least=20,
            bounds=(90.0, 100.0),
        ),
    ]


def _with_ruined(rng: np.random.Generator, share: float, factor: float, seeds: int, studies: int) -> list[Judgement]:
    made = []
    for _ in range(studies):
        a, b, _ = study(rng, lognormal, 1, seeds)[0]
        made += judged([log_ratios(a, np.where(rng.random(seeds) < share, factor, 1.0) * b)])
    return made


def power(rng: np.random.Generator, studies: int) -> list[Table]:
    """Comparisons that are undecided with 10 seeds, repeated with the stated number of seeds."""
    truths = (1.0, 1.05, 1.1, 1.15, 1.2)
    names = ("normal", "lognormal", "skewed", "t3")
    ends = {name: [_decided(rng, OWN[name], truth, studies // 3) for truth in truths] for name in names}
    title = "Comparisons with a stated number of seeds, of the comparisons that are undecided with 10 seeds [%]"
    named = Table(title, "errors, true ratio", truths)
    for name, of in ends.items():
        named.add(name, [told for told, _, _ in of])
    table = Table("Decided comparisons with the stated number of seeds [%]", "errors, true ratio", truths[1:], POWER)
    for name, of in ends.items():
        table.add(name, [hits for _, hits, _ in of[1:]])
        line(f"{name}: median number of seeds", *(median for _, _, median in of[1:]))
    return [named, table]


def _decided(rng: np.random.Generator, own: Draw, truth: float, trials: int) -> tuple[list[bool], list[bool], str]:
    """Return the results of undecided comparisons.

    The first list states for each comparison whether a number of seeds is stated. The second list states for one
    comparison of each study whether this number decided the comparison. The text is the median number of seeds.
    """
    told, hits, numbers = [], [], []
    for _ in range(trials):
        first = _differences(rng, own, truth, (FAMILY, 10))
        judgements = _judged(first)
        undecided = [k for k, judgement in enumerate(judgements) if judgement.verdict is Verdict.UNDECIDED]
        needed = {k: seeds_needed(first[k], FAMILY, critical=judgements[k].critical) for k in undecided}
        told += [number is not None for number in needed.values()]
        known = [(k, number) for k, number in needed.items() if number is not None]
        if truth == 1.0 or not known:
            continue
        k, number = known[0]
        more = _differences(rng, own, truth, (FAMILY, number - 10))
        hits.append(_judged(np.hstack([first, more]))[k].verdict is not Verdict.UNDECIDED)
        numbers.append(number)
    return told, hits, f"{np.median(numbers):.0f}" if numbers else "-"


def _differences(rng: np.random.Generator, own: Draw, truth: float, shape: tuple[int, int]) -> Array:
    return own(rng, shape) - own(rng, shape) + np.log(truth)


def _judged(d: Array) -> list[Judgement]:
    return judged([log_ratios(np.exp(row), np.ones(len(row))) for row in d])


def automatic(rng: np.random.Generator, studies: int) -> list[Table]:
    """False verdicts and number of seeds of `seeds=auto`, which adds seeds in blocks until everything is decided."""
    table = Table(
        "Studies with a false verdict with `seeds=auto(max=400)`, ten scenarios [%]",
        "errors",
        ("false verdict",),
        FALSE,
    )
    for name in ("normal", "lognormal", "skewed", "t3", "10 % x 50"):
        ends = [_spent(study(rng, OWN[name], 10, 400)) for _ in range(max(1, studies // 4))]
        table.add(f"{name} ({np.mean([seeds for _, seeds in ends]):.0f} seeds, mean)", [[wrong for wrong, _ in ends]])
    return [table]


def _spent(errors: Array) -> tuple[bool, int]:
    sizes = interim_sizes(400)
    for seeds, level in zip(sizes, interim_levels(sizes), strict=True):
        words = {judgement.verdict for judgement in judged(pairs(errors[:, :, :seeds]), level=float(level))}
        if words - {Verdict.UNDECIDED, Verdict.EQUAL}:
            return True, seeds
        if Verdict.UNDECIDED not in words:
            return False, seeds
    return False, sizes[-1]


TABLES: Mapping[str, Callable[[np.random.Generator, int], list[Table]]] = {
    "cells": cells,
    "ratios": ratios,
    "false_sentences": false_sentences,
    "false_equals": false_equals,
    "whole_studies": whole_studies,
    "power": power,
    "automatic": automatic,
    "few_seeds": of_few_seeds,
    "selection": selection,
    "unseen": unseen,
    "ruined": ruined,
    "opposite": opposite,
}
"""Functions (random generator, number of studies of 60 scenarios) -> tables. Smaller studies are more numerous."""


def main() -> None:
    """Print all or the selected tables, and the values that miss their targets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=150, help="number of simulated studies of 60 scenarios")
    parser.add_argument("--only", choices=TABLES, nargs="*", help="print only these tables")
    chosen = parser.parse_args()
    outside: list[str] = []
    for number, (name, made) in enumerate(TABLES.items()):
        if chosen.only and name not in chosen.only:
            continue
        began_s = time.process_time()
        outside += [
            line for table in made(np.random.default_rng([14, number]), chosen.studies) for line in table.outside
        ]
        print(f"\n{time.process_time() - began_s:.0f} s of CPU time.", flush=True)
    print("\n## Values that miss their targets\n", *(f"- {line}" for line in outside or ["nothing"]), sep="\n")


if __name__ == "__main__":
    main()
