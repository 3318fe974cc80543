"""Two methods over many scenarios: a mixed model of their log ratios, the worst scenario, ranks and their range."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray


@dataclass(frozen=True)
class OverScenarios:
    """How a compares with b over S scenarios with the same n seeds in each.

    Attributes:
        ratio: geometric mean of a/b over scenarios and seeds.
        low: lower end of its interval over scenarios and seeds that were not drawn; NaN of fewer than two scenarios.
        high: upper end.
        dof: degrees of freedom of the interval (Satterthwaite).
        scenario_sigma: standard deviation of the log ratio from scenario to scenario.
        seed_sigma: from seed to seed, common to the scenarios.
        sigma: of what is left.
        worst: index of the scenario where a compares worst.
        worst_ratio: geometric mean of a/b there.
        scenarios: S.
    """

    ratio: float
    low: float
    high: float
    dof: float
    scenario_sigma: float
    seed_sigma: float
    sigma: float
    worst: int
    worst_ratio: float
    scenarios: int


def over_scenarios(d: FloatArray, confidence: float = 0.95) -> OverScenarios:
    """Return the mixed model of (S, n) log ratios log(a/b), all finite.

    ::

        d_si = mu + u_s + v_i + e_si        u_s ~ N(0, sigma_u^2), v_i ~ N(0, sigma_v^2), e_si ~ N(0, sigma_e^2)

    which is log error ~ method + (method | scenario) + (method | seed) for two methods: what scenarios and seeds do to
    both alike cancels in d. With the mean squares of scenarios, seeds and rest::

        sigma_e^2 = MSE,  sigma_u^2 = (MSS - MSE)/n,  sigma_v^2 = (MSI - MSE)/S,  var(mu) = (MSS + MSI - MSE)/(S n)

    A variance that would be negative is 0, and its mean square joins the rest: for these balanced data that is what
    restricted maximum likelihood gives.

    Source: Searle, Casella and McCulloch, "Variance Components", Wiley (1992), 4.5; Satterthwaite, "An approximate
    distribution of estimates of variance components", Biometrics Bulletin 2 (1946).
    """
    means = d.mean(axis=1)
    worst = int(np.argmax(means))
    mu = float(means.mean())
    components = _components(d)
    error, dof = _error(components, *d.shape)
    low, high = _ends(mu, error, dof, confidence) if len(d) > 1 else (np.nan, np.nan)
    return OverScenarios(
        ratio=float(np.exp(mu)),
        low=low,
        high=high,
        dof=dof,
        scenario_sigma=float(np.sqrt((components.scenario - components.rest) / d.shape[1])),
        seed_sigma=float(np.sqrt((components.seed - components.rest) / len(d))),
        sigma=float(np.sqrt(components.rest)),
        worst=worst,
        worst_ratio=float(np.exp(means[worst])),
        scenarios=len(d),
    )


def _ends(mu: float, error: float, dof: float, confidence: float) -> tuple[float, float]:
    from scipy.special import stdtrit

    half = float(stdtrit(dof, (1 + confidence) / 2)) * error
    return float(np.exp(mu - half)), float(np.exp(mu + half))


@dataclass(frozen=True)
class _Components:
    """Mean squares of scenarios, seeds and rest, each at least the rest's, and their degrees of freedom."""

    scenario: float
    seed: float
    rest: float
    freedom: tuple[float, float, float]


def _components(d: FloatArray) -> _Components:
    """Return the mean squares of (S, n), with what is no larger than the rest taken into it."""
    s, n = d.shape
    rows, columns, all_of_it = d.mean(axis=1), d.mean(axis=0), d.mean()
    scenario, seed = n * float(np.sum((rows - all_of_it) ** 2)), s * float(np.sum((columns - all_of_it) ** 2))
    rest = max(0.0, float(np.sum((d - all_of_it) ** 2)) - scenario - seed)
    sums = {"scenario": (scenario, s - 1.0), "seed": (seed, n - 1.0)}
    freedom = (s - 1.0) * (n - 1.0)
    for name in sorted(sums, key=lambda name: sums[name][0] / max(1.0, sums[name][1])):
        square, own = sums[name]
        if freedom > 0 and square * freedom <= rest * own:
            rest, freedom = rest + square, freedom + own
            del sums[name]
    each = rest / max(1.0, freedom)
    scenario, seed = (
        sums[name][0] / max(1.0, sums[name][1]) if name in sums else each for name in ("scenario", "seed")
    )
    own = tuple(sums[name][1] if name in sums else 0.0 for name in ("scenario", "seed"))
    return _Components(scenario, seed, each, (own[0], own[1], freedom))


def _error(components: _Components, scenarios: int, seeds: int) -> tuple[float, float]:
    """Return the standard error of the mean and its degrees of freedom.

    Of MSS + MSI - MSE what is the rest itself cancels.
    """
    both = components.freedom[0] > 0 and components.freedom[1] > 0
    kept = [
        (square, own)
        for square, own in zip((components.scenario, components.seed), components.freedom, strict=False)
        if own > 0
    ]
    terms = (
        [*kept, (-components.rest, components.freedom[2])]
        if both
        else kept or [(components.rest, components.freedom[2])]
    )
    total = sum(square for square, _ in terms)
    spread = sum(square**2 / own for square, own in terms if own > 0)
    return float(np.sqrt(total / (scenarios * seeds))), total**2 / spread if spread > 0 else np.inf
