"""Verdicts family by family: where a method beats the plain filter, tuned alike, on these drives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.audit.methods import Method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import TUNED, Losses
from jerkbench.campaigns.ratios import ratio_verdict
from jerkbench.evaluation.statistics.intervals import student_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL, Verdict


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

    method: Method
    family: str
    ratio: float
    low: float
    high: float
    verdict: Verdict


def family_verdicts(known: Losses, methods: Sequence[Method], protocol: AuditProtocol) -> list[FamilyVerdict]:
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


def _of_method(known: Losses, method: Method, protocol: AuditProtocol, confidence: float) -> list[FamilyVerdict]:
    plain = Method(method.filter, protocol.plain)
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
