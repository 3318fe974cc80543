"""Do the statistics hold what they say? Coverage, false sentences and power, by simulation: every truth is known.

Log errors of three methods over seeds that they share: what is common to a seed (sigma 0.3) and what is a method's own
(sigma 0.1, but for lock-outs), of the distributions of `OWN`. All means are equal, so any "better" is a false one.

``python benchmarks/statistics.py [--studies 400]``
"""

import argparse
import itertools
from collections.abc import Callable, Iterable

import numpy as np

from jerkbench.evaluation.statistics.exact import quantiles, share_interval
from jerkbench.evaluation.statistics.judgement import MARGIN, Judgement, Verdict, judged
from jerkbench.evaluation.statistics.log_ratio import LogRatios, log_ratios
from jerkbench.evaluation.statistics.scenarios import over_scenarios
from jerkbench.evaluation.statistics.seeds_needed import seeds_needed
from jerkbench.evaluation.statistics.sequential import levels, looks
from jerkbench.evaluation.statistics.student import student_interval

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

SEEDS = (3, 5, 6, 10, 20, 50)
SCENARIOS = (1, 10, 60)
SIGMA, COMMON = 0.1, 0.3
LOCK_OUTS, FACTOR = 0.1, 50.0
SKEW = 0.5
"""Sigma of the lognormal that the log errors follow: skewness 1.75."""

Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Errors themselves normal, their sigma a tenth of their mean."""
    z = np.maximum(1 + SIGMA * rng.standard_normal(shape), 0.01)
    return np.log(z)


def lognormal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Errors lognormal."""
    return SIGMA * rng.standard_normal(shape)


def skewed(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Log errors lognormal about their mean, those of the first method upwards, of the last downwards."""
    z = SIGMA * (np.exp(SKEW * rng.standard_normal(shape)) - np.exp(SKEW**2 / 2))
    if len(shape) > 2:
        z[:, 1] = SIGMA * rng.standard_normal(z[:, 1].shape)
        z[:, 2] *= -1
    return z


def t3(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Log errors of Student's t with 3 degrees of freedom."""
    return SIGMA * rng.standard_t(3, shape)


def lock_outs(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """A tenth of the runs, of each method its own, fifty times as wrong."""
    return SIGMA * rng.standard_normal(shape) + np.log(FACTOR) * (rng.random(shape) < LOCK_OUTS)


def lost(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """A tenth of the runs, of each method its own, lost."""
    return np.where(rng.random(shape) < LOCK_OUTS, np.inf, SIGMA * rng.standard_normal(shape))


OWN: dict[str, Draw] = {
    "normal": normal,
    "lognormal": lognormal,
    "skewed": skewed,
    "t3": t3,
    "10 % lock-outs": lock_outs,
    "10 % lost": lost,
}


def line(*cells: object) -> None:
    """Print a line of a Markdown table."""
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def head(title: str, first: str, rest: Iterable[object]) -> None:
    """Print a title and the head of a table."""
    cells = [first, *map(str, rest)]
    print(f"\n## {title}\n")
    line(*cells)
    line(*["---"] * len(cells))


def percent(hits: object) -> str:
    """Return a share as percent; a dash where there is none."""
    values = np.asarray(hits, dtype=float)
    return f"{100 * values.mean():.1f}" if len(values) else "-"


def cells(rng: np.random.Generator, samples: int) -> None:
    """Intervals of one cell: geometric mean, or with lock-outs median and share."""
    head("Coverage of a cell's 95 % interval [%]", "errors, seeds", SEEDS)
    for name in ("normal", "lognormal", "skewed", "t3"):
        truth = float(np.mean(OWN[name](np.random.default_rng(1), (4_000_000,))))
        line(f"{name}, geometric mean", *(percent(_means(OWN[name](rng, (samples, n)), truth)) for n in SEEDS))
    for name in ("10 % lock-outs", "10 % lost"):
        truth = float(np.median(OWN[name](np.random.default_rng(1), (4_000_000,))))
        drawn = {n: OWN[name](rng, (samples, n)) for n in SEEDS}
        line(f"{name}, median", *(percent(_medians(drawn[n], truth)) for n in SEEDS))
        line(f"{name}, share", *(percent(_shares(drawn[n] > 1)) for n in SEEDS))


def _means(values: Array, truth: float) -> list[bool]:
    ends = [student_interval(row, 0.95) for row in values]
    return [low <= truth <= high for low, high in ends]


def _medians(values: Array, truth: float) -> list[bool]:
    ends = [(of.low, of.high) for of in map(quantiles, values)]
    return [low <= truth <= high for low, high in ends if not np.isnan(low)]


def _shares(failed: Array) -> list[bool]:
    ends = [share_interval(int(row.sum()), len(row)) for row in failed]
    return [low <= LOCK_OUTS <= high for low, high in ends]


def study(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int) -> Array:
    """Return (S, 3, n) errors of three methods that are equally good."""
    common = COMMON * rng.standard_normal((scenarios, 1, seeds))
    return np.exp(common + own(rng, (scenarios, 3, seeds)))


def pairs(errors: Array) -> list[LogRatios]:
    """Return the log ratios of every pair of methods in every scenario."""
    return [log_ratios(*pair) for scenario in errors for pair in itertools.combinations(scenario, 2)]


def ratios(rng: np.random.Generator, samples: int) -> None:
    """Intervals of the ratio of two methods, of one scenario and over several."""
    head("Coverage of the 95 % interval of a ratio [%]", "errors, scenarios, seeds", SEEDS)
    for name, own in OWN.items():
        line(f"{name}, 1", *(percent(_ratios(rng, own, n, samples)) for n in SEEDS))
    for name, scenarios in itertools.product(("normal", "lognormal", "skewed", "t3"), SCENARIOS[1:]):
        line(f"{name}, {scenarios}", *(percent(_over(rng, OWN[name], scenarios, n, samples)) for n in SEEDS))


def _ratios(rng: np.random.Generator, own: Draw, seeds: int, samples: int) -> list[bool]:
    compared = pairs(study(rng, own, samples // 3, seeds))
    return [ends.low <= 1 <= ends.high for ends in judged(compared) if not np.isnan(ends.low)]


def _over(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int, samples: int) -> list[bool]:
    hits = []
    for _ in range(samples // 4):
        truths = 0.1 * rng.standard_normal((scenarios, 1))
        a, b = np.log(study(rng, own, scenarios, seeds)).transpose(1, 0, 2)[:2]
        model = over_scenarios(a - b + truths)
        hits.append(model.low <= 1 <= model.high)
    return hits


def false_sentences(rng: np.random.Generator, studies: int) -> None:
    """Studies of equal methods with any "better", "worse" or share of lost runs that differs."""
    head('Studies of equal methods with any false "better" [%]', "errors, scenarios, seeds", SEEDS)
    for scenarios, (name, own) in itertools.product(SCENARIOS, OWN.items()):
        many = studies if scenarios > 10 else 2 * studies if scenarios > 1 else 5 * studies
        rates = [[_any_false(study(rng, own, scenarios, n)) for _ in range(many)] for n in SEEDS]
        line(f"{name}, {scenarios}", *map(percent, rates))


def _any_false(errors: Array) -> bool:
    return any(judgement.verdict not in {Verdict.UNDECIDED, Verdict.EQUAL} for judgement in judged(pairs(errors)))


def whole_studies(rng: np.random.Generator, studies: int) -> None:
    """Families as large as those of real studies: half of the methods have errors four times as large."""
    title = "A study of 1200 comparisons: ten scenarios of 16 methods, half of them four times worse [%]"
    sizes = (10, 20, 50)
    head(title, "errors, of two methods", [f"{n} seeds" for n in sizes])
    for name in ("normal", "t3", "skewed", "10 % lock-outs"):
        seen = [[_of_study(_two_levels(rng, OWN[name], n)) for _ in range(studies)] for n in sizes]
        line(f"{name}, four times: decided", *(percent([share for share, _ in ends]) for ends in seen))
        line(
            f"{name}, equal: studies with any difference shown", *(percent([any_ for _, any_ in ends]) for ends in seen)
        )


def _two_levels(rng: np.random.Generator, own: Draw, seeds: int) -> Array:
    """Return (10, 16, n) errors, those of the last eight methods four times as large."""
    common = COMMON * rng.standard_normal((10, 1, seeds))
    scatter = own(rng, (10, 16, seeds))
    return np.exp(common + scatter / 2 + np.log(4) * (np.arange(16) >= 8)[:, None])


def _of_study(errors: Array) -> tuple[float, bool]:
    """Return the share of different pairs that is decided, and whether any difference is shown of equal ones."""
    places = list(itertools.combinations(range(16), 2)) * len(errors)
    differ = np.array([a < 8 <= b for a, b in places])
    shown = np.array(
        [judgement.verdict not in {Verdict.UNDECIDED, Verdict.EQUAL} for judgement in judged(pairs(errors))]
    )
    return float(shown[differ].mean()), bool(shown[~differ].any())


def false_equals(rng: np.random.Generator, studies: int) -> None:
    """Studies of methods that differ by the margin itself, of which "equal" is false."""
    head('Studies of methods just not equal with any "equal" [%]', "errors, scenarios, seeds", SEEDS)
    for scenarios, name in itertools.product(SCENARIOS[:2], ("normal", "lognormal", "skewed", "t3")):
        rates = [[_any_equal(rng, OWN[name], scenarios, n) for _ in range(2 * studies)] for n in SEEDS]
        line(f"{name}, {scenarios}", *map(percent, rates))


def _any_equal(rng: np.random.Generator, own: Draw, scenarios: int, seeds: int) -> bool:
    d = (own(rng, (3 * scenarios, seeds)) - own(rng, (3 * scenarios, seeds))) / 8 + np.log1p(MARGIN)
    return any(
        judgement.verdict is Verdict.EQUAL
        for judgement in judged([log_ratios(np.exp(row), np.ones(seeds)) for row in d])
    )


def power(rng: np.random.Generator, studies: int) -> None:
    """Pairs that 10 seeds left undecided, run again with as many seeds as were named."""
    for family, truths in ((1, (1.0, 1.01, 1.02, 1.05, 1.1, 1.3)), (30, (1.0, 1.1))):
        words = "alone" if family == 1 else f"in a study of {family} comparisons"
        head(f"Decided with the seeds that were named, of what 10 seeds left undecided, {words} [%]", "errors", truths)
        for name in ("normal", "lognormal", "skewed", "t3"):
            trials = 5 * studies if family == 1 else studies
            ends = [_decided(rng, OWN[name], truth, trials, family) for truth in truths]
            line(name, *(percent(hits) for hits, _ in ends))
            line(f"{name}: seeds named, median", *(named for _, named in ends))


def _decided(rng: np.random.Generator, own: Draw, truth: float, trials: int, family: int) -> tuple[list[bool], str]:
    """Return whether the first undecided pair of each trial is decided by the seeds that were named for it."""
    hits, named = [], []
    for _ in range(trials):
        first = _differences(rng, own, truth, (family, 10))
        judgements = _judged(first)
        undecided = [k for k, judgement in enumerate(judgements) if judgement.verdict is Verdict.UNDECIDED]
        if not undecided:
            continue
        k = undecided[0]
        needed = seeds_needed(first[k], MARGIN, family, critical=judgements[k].critical) or 10
        more = _differences(rng, own, truth, (family, needed - 10))
        hits.append(_judged(np.hstack([first, more]))[k].verdict is not Verdict.UNDECIDED)
        named.append(needed)
    return hits, f"{np.median(named):.0f}" if named else "-"


def _differences(rng: np.random.Generator, own: Draw, truth: float, shape: tuple[int, int]) -> Array:
    return own(rng, shape) - own(rng, shape) + np.log(truth)


def _judged(d: Array) -> list[Judgement]:
    return judged([log_ratios(np.exp(row), np.ones(len(row))) for row in d])


def automatic(rng: np.random.Generator, studies: int) -> None:
    """Seeds in blocks until everything is decided: false sentences in spite of several looks, and seeds spent."""
    head("`seeds=auto(max=400)`, ten scenarios of three methods", "errors", ("any false [%]", "seeds, mean"))
    for name in ("normal", "lognormal", "skewed", "t3", "10 % lock-outs"):
        ends = [_spent(study(rng, OWN[name], 10, 400)) for _ in range(studies)]
        line(name, percent([wrong for wrong, _ in ends]), f"{np.mean([seeds for _, seeds in ends]):.0f}")


def _spent(errors: Array) -> tuple[bool, int]:
    sizes = looks(400)
    for seeds, level in zip(sizes, levels(sizes), strict=True):
        words = {judgement.verdict for judgement in judged(pairs(errors[:, :, :seeds]), level=float(level))}
        if words - {Verdict.UNDECIDED, Verdict.EQUAL}:
            return True, seeds
        if Verdict.UNDECIDED not in words:
            return False, seeds
    return False, sizes[-1]


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=100, help="simulated studies of 60 scenarios; of fewer more")
    studies = parser.parse_args().studies
    rng = np.random.default_rng(14)
    cells(rng, 20 * studies)
    ratios(rng, 12 * studies)
    false_sentences(rng, studies)
    false_equals(rng, studies)
    whole_studies(rng, max(1, studies // 4))
    power(rng, studies // 5)
    automatic(rng, studies // 4)


if __name__ == "__main__":
    main()
