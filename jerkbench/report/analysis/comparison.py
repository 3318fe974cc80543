"""Rows of runs -> each combination against a baseline, over the same seeds."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.statistics.paired import PairedRatio, holm, paired_ratio
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.rows import checked

if TYPE_CHECKING:
    import pandas as pd

LEVEL = 0.05
"""Below it, a difference counts as shown."""

METHOD = ("filter", "adaptation")
"""Factors that make no scenario."""

Combination = tuple[str, ...]
"""The values of the six factors."""


@dataclass(frozen=True)
class Comparison:
    """One combination against another.

    Attributes:
        subject: values of the six factors.
        baseline: of what it is compared with.
        paired: ratio of the metric, subject over baseline, over the seeds that went well in both; of phases of one
            recording ``low`` and ``high`` are the smallest and the largest ratio, and there is no p.
        p: corrected for the family (those of the same scenario) by Holm; NaN for phases.
        runs: seeds that both have.
        lost: how many of the subject's runs diverged or failed.
        lost_baseline: how many of the baseline's.
        replicate: "seed" or "phase".
        needed: how many seeds could show a difference in its family, where its own cannot whatever they are; else 0.
    """

    subject: Combination
    baseline: Combination
    paired: PairedRatio
    p: float
    runs: int
    lost: int
    lost_baseline: int
    replicate: str
    needed: int = 0

    @property
    def shown(self) -> bool:
        """Whether a difference was shown: the corrected test says so, and so does the interval."""
        return self.p < LEVEL and not self.paired.low <= 1.0 <= self.paired.high


def family_note(comparisons: Sequence[Comparison]) -> str:
    """Say what a difference that was shown means, and whether the seeds could show any."""
    tested = [[comparisons[k] for k in family if comparisons[k].p >= 0] for family in families(comparisons)]
    largest = max(map(len, tested), default=0)
    if largest == 0:
        return "Without seeds there is no test of a difference."
    seeds = max(one.paired.n for family in tested for one in family)
    note = f"*: a difference was shown (5 %, Wilcoxon, Holm over the up to {largest} comparisons of a scenario)."
    needed = seeds_needed(largest)
    return f"{note} {seeds} seeds cannot show any; {needed} could." if seeds < needed else note


def parse_baseline(text: str) -> dict[str, str]:
    """Read ``factor=value[;factor=value]`` (a comma does as well, where no value has one).

    Raises:
        JerkbenchError: it is not of that form, or names no factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    found = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
        found[key] = value
    return found


def compare_to(rows: "pd.DataFrame", metric: str, baseline: Mapping[str, str]) -> list[Comparison]:
    """Compare every combination with the one that is like it but for the factors of ``baseline``.

    What has no such partner, or is the partner itself, is left out. Those of one scenario are a family for Holm.

    Raises:
        JerkbenchError: no combination has the values of the baseline, or there is no such metric.
    """
    rows = checked(rows, metric)
    groups = {
        tuple(map(str, key)): group.set_index("seed")
        for key, group in rows.groupby([*FACTORS], sort=False, observed=True)
    }
    partners = {key: with_values(key, baseline) for key in groups}
    if not any(partner in groups for partner in partners.values()):
        raise JerkbenchError(_no_baseline(rows, baseline))
    found = [
        compare_groups(key, groups[key], partner, groups[partner], metric)
        for key, partner in partners.items()
        if partner in groups and partner != key
    ]
    return corrected(found)


def corrected(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Return the comparisons with p corrected, for those of one scenario together, and with the seeds they need."""
    result = list(comparisons)
    for places in families(comparisons):
        family = [comparisons[k] for k in places]
        corrected_p = holm([one.p for one in family])
        for place, one, p, needed in zip(places, family, corrected_p, _needed(family), strict=True):
            result[place] = dataclasses.replace(one, p=float(p), needed=needed)
    return result


def _needed(family: Sequence[Comparison]) -> list[int]:
    """Return for each how many seeds could show a difference, or 0 where its own could, or there is no test.

    Holm's p only grows with each p of the family: where even the smallest that so many seeds can have is not below
    the level, no values would be.
    """
    smallest = holm([0.5 ** (one.paired.n - 1) if one.p >= 0 else np.nan for one in family])
    seeds = seeds_needed(max(1, int(np.sum(~np.isnan(smallest)))))
    return [seeds if p >= LEVEL else 0 for p in smallest]


def families(comparisons: Sequence[Comparison]) -> list[list[int]]:
    """Return the indices of the comparisons of each scenario: one data set, disturbance, attitude and noise."""
    found: dict[Combination, list[int]] = {}
    for k, one in enumerate(comparisons):
        scenario = tuple(v for key, v in zip(FACTORS, one.subject, strict=True) if key not in METHOD)
        found.setdefault(scenario, []).append(k)
    return list(found.values())


def seeds_needed(family: int) -> int:
    """Return how many seeds a family of so many comparisons needs, so that the largest difference could be shown."""
    return int(np.ceil(np.log2(2 * family / LEVEL)))


def compare_groups(
    subject: Combination, ours: "pd.DataFrame", baseline: Combination, theirs: "pd.DataFrame", metric: str
) -> Comparison:
    """Compare two combinations, whose rows are indexed by seed."""
    seeds = ours.index.intersection(theirs.index)
    ours, theirs = ours.loc[seeds], theirs.loc[seeds]
    well = ((ours["status"] == "ok") & (theirs["status"] == "ok")).to_numpy()
    a, b = (one[metric].to_numpy(dtype=float)[well] for one in (ours, theirs))
    phases = bool((ours["replicate"] == "phase").any())
    paired = _of_phases(paired_ratio(a, b), a, b) if phases else paired_ratio(a, b)
    lost, lost_baseline = (int((one["status"] != "ok").sum()) for one in (ours, theirs))
    replicate = "phase" if phases else "seed"
    return Comparison(subject, baseline, paired, paired.p, len(seeds), lost, lost_baseline, replicate)


def with_values(combination: Combination, values: Mapping[str, str]) -> Combination:
    """Return the combination with some of its factors replaced."""
    return tuple(values.get(key, value) for key, value in zip(FACTORS, combination, strict=True))


def _of_phases(paired: PairedRatio, a: "np.ndarray[tuple[int], np.dtype[np.float64]]", b: object) -> PairedRatio:
    """Put the range in the place of the interval, and no p: phases of one recording are not independent."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = a / np.asarray(b, dtype=np.float64)
    ratios = ratios[np.isfinite(ratios)]
    low, high = (float(ratios.min()), float(ratios.max())) if len(ratios) > 1 else (np.nan, np.nan)
    return dataclasses.replace(paired, low=low, high=high, p=np.nan)


def _no_baseline(rows: "pd.DataFrame", baseline: Mapping[str, str]) -> str:
    key, value = next(((k, v) for k, v in baseline.items() if v not in set(rows[k])), next(iter(baseline.items())))
    if value in set(rows[key]):
        asked = ", ".join(f"{k}={v}" for k, v in baseline.items())
        return f"No combination has {asked} together; `jerkbench table DIR` shows those that there are."
    return unknown(key, value, {str(one) for one in rows[key]})
