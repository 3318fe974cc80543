"""The verdicts of an audit: each method against the plain filter of its model, tuned alike, on what neither saw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.campaign import Outcome
from jerkbench.audit.methods import AuditMethod, by_method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stages import Search
from jerkbench.campaigns.protocol import HALVES, FaultScenario
from jerkbench.campaigns.ratios import fastest_step_ns, nominal_of, of_families, of_unseen, ratio_verdict, worst_of
from jerkbench.campaigns.search import ALL, levels_of, losses
from jerkbench.evaluation.statistics.intervals import student_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL, Verdict
from jerkbench.evaluation.statistics.ranks import OverScenarios, over_scenarios, rank_range

DEFAULTS = "defaults"
TUNED = "tuned"
BOUND = "best for each"
"""Tuned on the very scenario: what no one setting reaches; marked, and never compared."""


@dataclass(frozen=True)
class MethodVerdict:
    """One method against the tuned plain filter of its model; ratios below 1 are better.

    Attributes:
        method: which.
        default: ratio at its defaults.
        tuned: ratio tuned, over the families of faults, with its 95 % interval.
        low: lower end of the interval that holds for all methods at once.
        high: upper end.
        verdict: better, equal, worse or undecided, by that interval.
        p_better: probability that it is better by more than the margin.
        restarts: the lowest and the highest ratio among the restarts of the search.
        all_ratio: tuned on everything (no fair score).
        bound: tuned for each scenario by itself (no fair score).
        worst: name of the scenario where it is worst, tuned.
        worst_ratio: its ratio there.
        nominal: ratio where nothing is wrong: the price.
        lost: share of its tuned runs that were lost.
        anees: median of its tuned runs; 6 is expected.
        step_ns: time a step [ns], side by side.
        places: its place among all methods, and the range of it (95 %).
    """

    method: AuditMethod
    default: float
    tuned: OverScenarios
    low: float
    high: float
    verdict: Verdict
    p_better: float
    restarts: tuple[float, float]
    all_ratio: float
    bound: float
    worst: str
    worst_ratio: float
    nominal: float
    lost: float
    anees: float
    step_ns: float
    places: tuple[int, int, int]


@dataclass(frozen=True)
class Losses:
    """The losses of every method on the seeds to test on.

    Attributes:
        families: names, in order.
        scenarios: of the audit.
        by_kind: (S, n) loss of each method by how it was set: defaults, tuned (of each restart), all, best for each.
    """

    families: tuple[str, ...]
    scenarios: Sequence[FaultScenario]
    by_kind: Mapping[tuple[AuditMethod, str, int], FloatArray]

    def of_families(self, values: FloatArray) -> FloatArray:
        """Return (F, n) means over the scenarios of each family."""
        return of_families(values, self.scenarios)


def losses_of(outcome: Outcome, protocol: AuditProtocol, scenarios: Sequence[FaultScenario]) -> Losses:
    """Return the losses of the test; a setting is scored on the half that its search has not seen.

    A scenario of both halves is scored with the settings of both, and their mean counts.
    """
    test = outcome.test
    test = test.assign(loss=losses(test, levels_of(test, protocol.plain)))
    by_kind: dict[tuple[AuditMethod, str, int], FloatArray] = {}
    for method, rows in by_method(test).items():
        cube = rows.pivot_table(index="scenario", columns=["trial", "seed"], values="loss").sort_index()
        by_kind[method, DEFAULTS, 0] = cube[0].to_numpy()
        by_kind[method, BOUND, 0] = cube[outcome.bound[method]].to_numpy()
        by_kind[method, ALL, 0] = cube[outcome.trial[Search(method, ALL, 0)]].to_numpy()
        for restart in range(protocol.restarts):
            halves = [cube[outcome.trial[Search(method, half, restart)]].to_numpy() for half in HALVES]
            by_kind[method, TUNED, restart] = of_unseen(halves, scenarios)
    families = tuple(family.name for family in protocol.families)
    return Losses(families, scenarios, by_kind)


def verdicts(outcome: Outcome, protocol: AuditProtocol, scenarios: Sequence[FaultScenario]) -> list[MethodVerdict]:
    """Return the verdict of every method but the plain ones and the references, the best first."""
    known = losses_of(outcome, protocol, scenarios)
    ranked = [m for m in outcome.bound if m.adaptation in protocol.compared and m.filter in protocol.filters]
    compared = [m for m in ranked if m.adaptation != protocol.plain]
    places = _places(known, ranked)
    rows = by_method(outcome.test)
    judged = [_verdict(m, known, outcome, protocol, rows[m], len(compared), places[m]) for m in compared]
    return sorted(judged, key=lambda verdict: verdict.tuned.ratio)


def _verdict(
    method: AuditMethod,
    known: Losses,
    outcome: Outcome,
    protocol: AuditProtocol,
    rows: pd.DataFrame,
    count: int,
    places: tuple[int, int, int],
) -> MethodVerdict:
    plain = AuditMethod(method.filter, protocol.plain)
    d = _difference(known, method, plain, TUNED)
    tuned = over_scenarios(known.of_families(d))
    wide = over_scenarios(known.of_families(d), 1 - LEVEL / count)
    ratios = [_ratio(known, _difference(known, method, plain, TUNED, k)) for k in range(protocol.restarts)]
    worst, worst_ratio = worst_of(d, known.scenarios)
    own = own_rows(rows, method, outcome, known.scenarios)
    return MethodVerdict(
        method=method,
        default=_ratio(known, known.by_kind[method, DEFAULTS, 0] - known.by_kind[plain, TUNED, 0]),
        tuned=tuned,
        low=wide.low,
        high=wide.high,
        verdict=ratio_verdict(wide.low, wide.high, protocol.margin),
        p_better=probability_below(tuned, 1 / (1 + protocol.margin)),
        restarts=(min(ratios), max(ratios)),
        all_ratio=_ratio(known, _difference(known, method, plain, ALL)),
        bound=_ratio(known, _difference(known, method, plain, BOUND)),
        worst=worst,
        worst_ratio=worst_ratio,
        nominal=nominal_of(d, known.scenarios),
        lost=float((own["status"] != "ok").mean()),
        anees=float(own["anees"].median()),
        step_ns=fastest_step_ns(rows, protocol.duration_s),
        places=places,
    )


def probability_below(mean: OverScenarios, ratio: float) -> float:
    """Return the probability that the mean ratio lies below ``ratio``: Student's t about the mean of the logarithms."""
    from scipy.special import stdtr, stdtrit

    error = np.log(mean.high / mean.low) / 2 / stdtrit(mean.dof, 0.975)
    if not error > 0:
        return float(mean.ratio < ratio)
    return float(stdtr(mean.dof, (np.log(ratio) - np.log(mean.ratio)) / error))


def _difference(known: Losses, method: AuditMethod, plain: AuditMethod, kind: str, restart: int = 0) -> FloatArray:
    return known.by_kind[method, kind, restart] - known.by_kind[plain, kind, restart]


def _ratio(known: Losses, difference: FloatArray) -> float:
    """Geometric mean over families, each with the same weight."""
    return float(np.exp(known.of_families(difference).mean()))


def own_rows(
    rows: pd.DataFrame, method: AuditMethod, outcome: Outcome, scenarios: Sequence[FaultScenario]
) -> pd.DataFrame:
    """Return the rows of a method with the setting that was tuned on the other half, of the first restart."""
    trial = {half: outcome.trial[Search(method, half, 0)] for half in HALVES}
    wanted = {"first": {trial["second"]}, "second": {trial["first"]}, "both": set(trial.values())}
    pairs = {(number, place) for number, scenario in enumerate(scenarios) for place in wanted[scenario.half]}
    return rows[[key in pairs for key in zip(rows["scenario"], rows["trial"], strict=True)]]


def _places(known: Losses, methods: Sequence[AuditMethod]) -> dict[AuditMethod, tuple[int, int, int]]:
    """Place of each method by its mean log error, the range over families and seeds."""
    costs = np.stack([known.of_families(known.by_kind[m, TUNED, 0]) for m in methods], axis=-1)
    ranks = rank_range(costs)
    return {m: (int(ranks.place[k]), int(ranks.low[k]), int(ranks.high[k])) for k, m in enumerate(methods)}


# Verdicts under each family of faults.


@dataclass(frozen=True)
class FamilyVerdict:
    """One method against the tuned plain filter of its model, under one family of faults.

    Attributes:
        method: which.
        family: of faults.
        ratio: geometric mean over the family's scenarios and the seeds; below 1 is better.
        low: lower end of an interval over seeds that holds for all methods and families at once.
        high: upper end.
        verdict: by that interval.
    """

    method: AuditMethod
    family: str
    ratio: float
    low: float
    high: float
    verdict: Verdict


def family_verdicts(known: Losses, methods: Sequence[AuditMethod], protocol: AuditProtocol) -> list[FamilyVerdict]:
    """Return the verdict of every method under every family, methods in the given order.

    The seeds are the sample, and the scenarios are what they are: Student's interval of the mean log ratio, for all
    pairs at once (Bonferroni). It says nothing about faults that are not there.
    """
    confidence = 1 - LEVEL / (len(methods) * len(known.families))
    return [verdict for method in methods for verdict in _of_method(known, method, protocol, confidence)]


def family_frame(verdicts: Sequence[FamilyVerdict]) -> pd.DataFrame:
    """Return the verdicts, one a row."""
    return pd.DataFrame(
        [
            {
                "filter": verdict.method.filter,
                "adaptation": verdict.method.adaptation,
                "family": verdict.family,
                "ratio": verdict.ratio,
                "low_of_all": verdict.low,
                "high_of_all": verdict.high,
                "verdict": str(verdict.verdict),
            }
            for verdict in verdicts
        ]
    )


def family_sentences(verdicts: Sequence[FamilyVerdict]) -> list[str]:
    """Return, for each family, how many methods were shown better and worse, and which leads; the kindest first."""
    of_family: dict[str, list[FamilyVerdict]] = {}
    for verdict in verdicts:
        of_family.setdefault(verdict.family, []).append(verdict)
    kindest = sorted(of_family.items(), key=lambda item: -_count(item[1], Verdict.BETTER))
    return [_sentence(family, members) for family, members in kindest]


def _of_method(known: Losses, method: AuditMethod, protocol: AuditProtocol, confidence: float) -> list[FamilyVerdict]:
    plain = AuditMethod(method.filter, protocol.plain)
    d = known.of_families(known.by_kind[method, TUNED, 0] - known.by_kind[plain, TUNED, 0])
    low, high = (np.exp(ends) for ends in student_intervals(d, confidence))
    numbers = zip(known.families, np.exp(d.mean(axis=1)).tolist(), low.tolist(), high.tolist(), strict=True)
    return [FamilyVerdict(method, *of, ratio_verdict(of[2], of[3], protocol.margin)) for of in numbers]


def _sentence(family: str, verdicts: Sequence[FamilyVerdict]) -> str:
    best = min(verdicts, key=lambda verdict: verdict.ratio)
    better, worse = (_count(verdicts, word) for word in (Verdict.BETTER, Verdict.WORSE))
    lowest = f"the lowest ratio has {best.method.name} with {best.ratio:.2f}"
    return f"**{family}**: {better} of {len(verdicts)} better, {worse} worse; {lowest}."


def _count(verdicts: Sequence[FamilyVerdict], word: Verdict) -> int:
    return sum(verdict.verdict is word for verdict in verdicts)
