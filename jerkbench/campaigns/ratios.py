"""Ratios of a method to the plain filter, tuned alike: over families of faults, where it is worst, what they show."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaigns.protocol import HALVES, FaultScenario
from jerkbench.evaluation.statistics.judgement import Verdict

NOMINAL = "none"
"""The family without a fault."""

IMU_HZ = 100.0
"""Steps a second of the simulated fields."""


def of_families(values: FloatArray, scenarios: Sequence[FaultScenario]) -> FloatArray:
    """Return (F, n) means over the scenarios of each family: severities and fields of one fault are one unit."""
    names = np.array([scenario.family for scenario in scenarios])
    return np.array([values[names == family].mean(axis=0) for family in dict.fromkeys(names.tolist())])


def of_unseen(halves: Sequence[FloatArray], scenarios: Sequence[FaultScenario]) -> FloatArray:
    """Take each scenario from the search that did not see its half; of both, the mean.

    Args:
        halves: (S, n) losses of what was tuned on the first half, and on the second.
        scenarios: S of them.
    """
    wanted = [[half != scenario.half for half in HALVES] for scenario in scenarios]
    return np.array([np.stack(halves)[own, k].mean(axis=0) for k, own in enumerate(wanted)])


def worst_of(d: FloatArray, scenarios: Sequence[FaultScenario]) -> tuple[str, float]:
    """Return the scenario where log ratios (S, n) are worst, and the ratio there."""
    by_scenario = d.mean(axis=1)
    worst = int(np.argmax(by_scenario))
    return scenarios[worst].name, float(np.exp(by_scenario[worst]))


def nominal_of(d: FloatArray, scenarios: Sequence[FaultScenario]) -> float:
    """Return the ratio where nothing is wrong: the price."""
    nominal = np.array([scenario.family == NOMINAL for scenario in scenarios])
    return float(np.exp(d.mean(axis=1)[nominal].mean()))


def ratio_verdict(low: float, high: float, margin: float) -> Verdict:
    """Return what an interval of a ratio shows: equal within the margin, else better, worse or nothing."""
    if 1 / (1 + margin) <= low and high <= 1 + margin:
        return Verdict.EQUAL
    if high < 1:
        return Verdict.BETTER
    return Verdict.WORSE if low > 1 else Verdict.UNDECIDED


def ratio_word(low: float, high: float, margin: float) -> str:
    """Return the verdict of an interval of a ratio, as the audit has it: better or worse first, then equal.

    >>> ratio_word(0.92, 0.98, 0.1), ratio_word(0.95, 1.04, 0.1), ratio_word(0.8, 1.2, 0.1)
    ('better, by less than 10 %', 'equal', 'undecided')
    """
    shown = "better" if high < 1 else "worse" if low > 1 else ""
    if 1 / (1 + margin) <= low and high <= 1 + margin:
        return f"{shown}, by less than {100 * margin:g} %" if shown else "equal"
    return shown or "undecided"


def fastest_step_ns(rows: pd.DataFrame, duration_s: float) -> float:
    """Return the time of a step [ns], in the fastest of some runs."""
    return float(rows["seconds"].min() / (duration_s * IMU_HZ) * 1e9)
