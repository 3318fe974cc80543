"""The answer of an audit in sentences, each from the verdicts."""

from collections.abc import Sequence

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.audit.campaign import Outcome
from jerkbench.audit.methods import FLOOR, AuditMethod, by_method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import DEFAULTS, TUNED, Losses, MethodVerdict, own_rows
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.evaluation.statistics.ranks import OverScenarios, over_scenarios


def last_line(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Return the answer to the audit's question, in one line."""
    better = [verdict for verdict in verdicts if verdict.verdict is Verdict.BETTER]
    harmless = [verdict for verdict in better if verdict.worst_ratio <= 1 + protocol.margin]
    answer = f"{len(better)} of {len(verdicts)} are shown to beat a tuned Kalman filter on average over all faults."
    if not better:
        return answer
    return f"{answer} {len(harmless)} of these are nowhere more than {100 * protocol.margin:g} % worse."


def sentences(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol, tuning: str) -> list[str]:
    """Return what a practitioner should know first, the most important first.

    Args:
        verdicts: of every method.
        protocol: of the audit.
        tuning: what tuning alone does to the plain filter, in a sentence.
    """
    return [
        f"{last_line(verdicts, protocol)} {_alone(verdicts)} {tuning}",
        *_best(verdicts),
        f"{_price(verdicts, protocol)} {_harmless(verdicts, protocol)}",
        *_defaults(verdicts),
        *_luck(verdicts),
    ]


def _alone(verdicts: Sequence[MethodVerdict]) -> str:
    """Say what intervals of single methods show, which nobody may pick the best of."""
    names = [verdict.method.name for verdict in verdicts if verdict.tuned.high < 1]
    which = f": {', '.join(names)}" if names else ""
    return f"All methods were tested together. Tested alone, {len(names)} would count as better{which}."


def _best(verdicts: Sequence[MethodVerdict]) -> list[str]:
    best = min(verdicts, key=lambda verdict: verdict.tuned.ratio)
    interval = f"95 % over families {best.tuned.low:.2f} to {best.tuned.high:.2f}"
    lowest = f"{best.method.name} has the lowest ratio to the tuned plain filter, {best.tuned.ratio:.2f} ({interval})"
    return [f"{lowest}. In its worst scenario ({best.worst}) the ratio is {best.worst_ratio:.2f}."]


def _price(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    dear = [verdict for verdict in verdicts if verdict.nominal > 1 + protocol.margin]
    advice = " So adapt only where you expect a fault." if 2 * len(dear) > len(verdicts) else ""
    percent = f"{100 * protocol.margin:g} %"
    return f"Without a fault, the tuned error of {len(dear)} of {len(verdicts)} is more than {percent} higher.{advice}"


def _harmless(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Say how many are nowhere worse, and how bad the worst scenario of a typical method is."""
    harmless = [verdict for verdict in verdicts if verdict.worst_ratio <= 1 + protocol.margin]
    middle = sorted(verdict.worst_ratio for verdict in verdicts)[len(verdicts) // 2]
    worse = len(verdicts) - len(harmless)
    return (
        f"{worse} of {len(verdicts)} are more than {100 * protocol.margin:g} % worse than the plain filter in at least"
        f" one scenario. In its worst scenario, the median method has {middle:.1f} times the error of the plain filter."
    )


def _defaults(verdicts: Sequence[MethodVerdict]) -> list[str]:
    better = sum(verdict.default < 1 for verdict in verdicts)
    changed = sum((verdict.default < 1) != (verdict.tuned.ratio < 1) for verdict in verdicts)
    ahead = f"At their defaults, {better} of {len(verdicts)} have a smaller error than the tuned plain filter."
    return [f"{ahead} Tuning changes the side of {changed}."]


def _luck(verdicts: Sequence[MethodVerdict]) -> list[str]:
    spread = max(verdict.restarts[1] / verdict.restarts[0] for verdict in verdicts)
    percent = f"{100 * (spread - 1):.0f} %"
    return [f"Searches with other random numbers change the ratio of one method by up to {percent}."]


# What is said beside the answer.


EXPECTED_ANEES = 6.0
"""Of a consistent filter: position and velocity have six components."""


def tuning_sentence(known: Losses, protocol: AuditProtocol) -> str:
    """Say what tuning alone does to the plain filters, on faults that it has not seen."""
    parts = []
    for model in protocol.filters:
        plain = AuditMethod(model, protocol.plain)
        change = _over(known, known.by_kind[plain, TUNED, 0] - known.by_kind[plain, DEFAULTS, 0])
        parts.append(f"{_interval(change)} ({model})")
    head = "Tuning alone multiplies the error of the plain filter, on faults that it was not tuned on, by"
    return f"{head} {', '.join(parts)}."


def reference_sentences(known: Losses, protocol: AuditProtocol) -> list[str]:
    """Say where the tuned plain filters stand between GNSS alone and the filter that is told the true R."""
    floor = AuditMethod(FLOOR, protocol.plain)
    plains = [AuditMethod(model, protocol.plain) for model in protocol.filters]
    told = "The same filter told the true R"
    pairs = [
        (plain, other, words)
        for plain in plains
        for other, words in [
            (floor, "GNSS alone"),
            *((AuditMethod(plain.filter, r), told) for r in protocol.references),
        ]
    ]
    return [
        f"{words} has {_interval(_over(known, known.by_kind[other, TUNED, 0] - known.by_kind[plain, TUNED, 0]))} of the"
        f" error of {plain.name}, tuned."
        for plain, other, words in pairs
        if (other, TUNED, 0) in known.by_kind
    ]


def model_sentence(known: Losses, protocol: AuditProtocol) -> str:
    """Say what another model does without any adaptation, tuned alike; empty where there is one model."""
    first, *others = [AuditMethod(name, protocol.plain) for name in (*protocol.filters, *protocol.apart)]
    plain = known.by_kind[first, TUNED, 0]
    parts = [
        f"{method.filter} {_interval(_over(known, known.by_kind[method, TUNED, 0] - plain))}"
        for method in others
        if (method, TUNED, 0) in known.by_kind
    ]
    head = f"Without any adaptation, of the error of {first.name} and tuned like it, another model has"
    return f"{head}: {', '.join(parts)}." if parts else ""


def noise_sentence(known: Losses, verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Say whether the order with white GNSS noise is that with coloured noise; empty of one kind of noise."""
    kinds = list(protocol.fields)
    if len(kinds) < 2 or len(verdicts) < 3:
        return ""
    ratios = {kind: np.array([_on(known, verdict.method, protocol, kind) for verdict in verdicts]) for kind in kinds}
    ahead = ", ".join(f"{int((ratios[kind] < 1).sum())} of {len(verdicts)} with {kind} noise" for kind in kinds)
    lead = ", ".join(f"{verdicts[int(ratios[kind].argmin())].method.name} with {kind} noise" for kind in kinds)
    turned = int(((ratios[kinds[0]] < 1) != (ratios[kinds[1]] < 1)).sum())
    return (
        f"White against coloured noise: ahead of the tuned plain filter, whatever the interval, are {ahead}; {turned}"
        f" change sides. The lowest ratio has {lead}. Rank correlation of the two orders:"
        f" {_rank_correlation(*ratios.values()):.2f}."
    )


def metric_sentence(outcome: Outcome, known: Losses, verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Say whether what is good by the error is consistent as well (ANEES against the 6 that is expected)."""
    if len(verdicts) < 3:
        return ""
    rows = by_method(outcome.test)
    plains = [AuditMethod(model, protocol.plain) for model in protocol.filters]
    plain = {m.filter: off_by(float(own_rows(rows[m], m, outcome, known.scenarios)["anees"].median())) for m in plains}
    ahead = [verdict for verdict in verdicts if verdict.tuned.ratio < 1]
    closer = sum(off_by(verdict.anees) < plain[verdict.method.filter] for verdict in ahead)
    orders = np.array([(verdict.tuned.ratio, off_by(verdict.anees)) for verdict in verdicts]).T
    return (
        f"Metric against metric: of the {len(ahead)} with a smaller error than the tuned plain filter, {closer} have an"
        f" ANEES closer to the expected {EXPECTED_ANEES:g} as well. Rank correlation of error and consistency:"
        f" {_rank_correlation(*orders):.2f}."
    )


def power_sentence(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Say what the intervals over families could have shown."""
    spans = [float(np.sqrt(verdict.high / verdict.low)) for verdict in verdicts]
    alone = [float(np.sqrt(verdict.tuned.high / verdict.tuned.low)) for verdict in verdicts]
    middle, own = float(np.median(spans)), float(np.median(alone))
    return (
        f"Power: there are {len(protocol.families)} families. Tested together with all others, the interval of a"
        f" typical method spans a factor of {middle:.2f} either way (alone {own:.2f}). So only a mean ratio below"
        f" {1 / middle:.2f} can be shown to be better. More seeds would not help, more kinds of faults would. Undecided"
        " does not mean equal."
    )


def off_by(anees: float) -> float:
    """Return how far an ANEES is from the expected one, as a logarithm: too small and too large count alike."""
    return abs(float(np.log(anees / EXPECTED_ANEES)))


def _over(known: Losses, difference: FloatArray) -> OverScenarios:
    return over_scenarios(known.of_families(difference))


def _interval(mean: OverScenarios) -> str:
    return f"{mean.ratio:.2f} ({mean.low:.2f} to {mean.high:.2f})"


def _on(known: Losses, method: AuditMethod, protocol: AuditProtocol, noise: str) -> float:
    """Ratio to the tuned plain filter with one kind of noise; families count alike."""
    d = known.by_kind[method, TUNED, 0] - known.by_kind[AuditMethod(method.filter, protocol.plain), TUNED, 0]
    here = [k for k, scenario in enumerate(known.scenarios) if scenario.noise == noise]
    families = np.array([known.scenarios[k].family for k in here])
    means = [d[here][families == family].mean() for family in dict.fromkeys(families.tolist())]
    return float(np.exp(np.mean(means)))


def _rank_correlation(a: FloatArray, b: FloatArray) -> float:
    from scipy.stats import spearmanr

    return float(spearmanr(a, b).statistic)
