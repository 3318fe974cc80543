"""Two sets of results: what became better or worse, combination by combination."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.judgement import LEVEL, Verdict, judged
from jerkbench.evaluation.statistics.log_ratio import LogRatios, log_ratios
from jerkbench.evaluation.statistics.paired import PairedRatio, holm, paired_ratio, unpaired_ratio
from jerkbench.report.analysis.comparison import Combination
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.rows import checked
from jerkbench.report.tables.table_model import factor_number, number

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Change:
    """One combination in two sets of results.

    Attributes:
        combination: values of the six factors (in the first set).
        means: geometric (arithmetic where a value is 0), of the runs that went well, in both sets.
        ratio: second over first.
        p: of the test, corrected for all combinations (on other seeds by Holm); NaN where there is none.
        paired: whether the seeds match.
        same: whether every value is the same to the bit.
        runs: in both sets.
        lost: runs that diverged or failed, in both sets.
        valued: runs that went well and have the metric, in both sets.
        absent: runs of the first set that the second does not have, where the seeds match.
        risen: on the same seeds, how many went up from a value of which there is no ratio (0, or below).
        judged: the verdict on the same seeds, where a lost run is the worst; None on others, and of phases.
    """

    combination: Combination
    means: tuple[float, float]
    ratio: PairedRatio
    p: float
    paired: bool
    same: bool
    runs: tuple[int, int]
    lost: tuple[int, int]
    valued: tuple[int, int]
    absent: int = 0
    risen: int = 0
    judged: Verdict | None = None

    def worse(self, percent: float) -> bool:
        """Whether the second is worse by more than ``percent``, or has the metric of a smaller share of its runs.

        On the same seeds any change is one; on others only what the whole interval says, where there is one.
        """
        limit = 1 + percent / 100
        judged = self.ratio.ratio if self.paired or math.isnan(self.ratio.low) else self.ratio.low
        return bool(judged > limit or self.risen or self.valued[1] * self.runs[0] < self.valued[0] * self.runs[1])

    @property
    def unjudged(self) -> bool:
        """Whether the second cannot be said to be as good: it lacks runs, or no run of both has a ratio."""
        return bool(self.absent or (not self.same and not math.isfinite(self.ratio.ratio)))

    @property
    def verdict(self) -> str:
        """In a few words."""
        if self.same:
            return "the same to the bit"
        if self.risen and not self.ratio.n:
            return "worse (it was 0)"
        if self.ratio.n == 0:
            return "no run of both to compare"
        if self.judged is not None:
            return "equal within 3 %" if self.judged is Verdict.EQUAL else self.judged.value
        shown = self.p < LEVEL and not self.ratio.low <= 1 <= self.ratio.high
        word = ("better" if self.ratio.ratio < 1 else "worse") if shown else "no difference shown"
        return word if self.paired else f"{word} (other seeds)"


def changes(before: "pd.DataFrame", after: "pd.DataFrame", metric: str) -> list[Change]:
    """Compare the combinations that both sets have; where each has a single one, these two, whatever they are called.

    Raises:
        JerkbenchError: nothing is in both, or of this metric the lowest is not the best.
    """
    if not quantity(metric).lowest_is_best:
        raise JerkbenchError(f"Of {metric} neither the lowest nor the highest is the best; compare another metric.")
    first, second = (_groups(checked(rows, metric)) for rows in (before, after))
    pairs = [(key, first[key], second[key]) for key in first if key in second]
    if not pairs and len(first) == len(second) == 1:
        (key, one), (other,) = next(iter(first.items())), second.values()
        pairs = [(key, one, other)]
    if not pairs:
        raise JerkbenchError(
            f"No combination of the {len(first)} of the first is among the {len(second)} of the second."
        )
    found = [_change(key, one, other, metric) for key, one, other in pairs]
    corrected = [
        dataclasses.replace(change, p=float(p))
        for change, p in zip(found, holm([change.p for change in found]), strict=True)
    ]
    seeded = [place for place, change in enumerate(corrected) if change.paired and not math.isnan(change.p)]
    verdicts = judged([_ratios(*pairs[place][1:], metric) for place in seeded])
    for place, judgement in zip(seeded, verdicts, strict=True):
        corrected[place] = dataclasses.replace(corrected[place], p=judgement.p, judged=judgement.verdict)
    return corrected


def _ratios(first: "pd.DataFrame", second: "pd.DataFrame", metric: str) -> LogRatios:
    """Return second over first on the common seeds; a lost run is the worst."""
    seeds = first.index.intersection(second.index)
    a, b = (
        np.where(one["status"] == "ok", one[metric].to_numpy(dtype=float), np.inf)
        for one in (first.loc[seeds], second.loc[seeds])
    )
    return log_ratios(b, a)


def change_rows(found: Sequence[Change], varying: Sequence[str]) -> list[list[str]]:
    """Return a line of texts for each change: the factors, both means, the ratio, its interval, the verdict."""
    return [
        [
            *(dict(zip(FACTORS, one.combination, strict=True))[key] for key in varying),
            *(_mean(mean, runs, lost) for mean, runs, lost in zip(one.means, one.runs, one.lost, strict=True)),
            f"×{factor_number(one.ratio.ratio)}" if math.isfinite(one.ratio.ratio) else "",  # noqa: RUF001
            _interval(one.ratio),
            one.verdict,
        ]
        for one in found
    ]


def _groups(rows: "pd.DataFrame") -> dict[Combination, "pd.DataFrame"]:
    grouped = rows.groupby([*FACTORS], sort=False, observed=True)
    return {tuple(map(str, key)): group.set_index("seed") for key, group in grouped}


def _change(key: Combination, first: "pd.DataFrame", second: "pd.DataFrame", metric: str) -> Change:
    seeds = first.index.intersection(second.index)
    paired = len(seeds) > 0
    absent = len(first.index.difference(second.index)) if paired else 0
    if paired:
        first, second = first.loc[seeds], second.loc[seeds]
    a, b = (one[metric].where(one["status"] == "ok").to_numpy(dtype=float) for one in (first, second))
    ratio = paired_ratio(b, a) if paired else unpaired_ratio(b, a)
    phases = bool((first["replicate"] == "phase").any())
    return Change(
        combination=key,
        means=(_average(a), _average(b)),
        ratio=ratio,
        p=math.nan if phases else ratio.p,
        paired=paired,
        same=paired and bool(np.array_equal(a, b, equal_nan=True) and list(first["status"]) == list(second["status"])),
        runs=(len(a), len(b)),
        lost=(int((first["status"] != "ok").sum()), int((second["status"] != "ok").sum())),
        valued=(int(np.isfinite(a).sum()), int(np.isfinite(b).sum())),
        absent=absent,
        risen=int(np.sum((b > a) & (a <= 0))) if paired else 0,
    )


def _interval(ratio: PairedRatio) -> str:
    return f"[{factor_number(ratio.low)}, {factor_number(ratio.high)}]" if math.isfinite(ratio.low) else ""


def _average(values: FloatArray) -> float:
    """The geometric mean of what is finite, as the ratio is one; arithmetic where a value has no logarithm."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan
    return float(np.exp(np.mean(np.log(known)))) if (known > 0).all() else float(np.mean(known))


def _mean(mean: float, runs: int, lost: int) -> str:
    text = number(mean) if math.isfinite(mean) else "n/a"
    return f"{text} ({lost}/{runs} lost)" if lost else text
