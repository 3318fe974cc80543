"""The runs of each combination of a study, and of two on common seeds."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.over_seeds import LogRatios, log_ratios_of
from jerkbench.report.analysis.factors import FACTORS

if TYPE_CHECKING:
    import pandas as pd

Combination = tuple[str, ...]
"""The values of the six factors."""


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of one combination.

    Attributes:
        combination: values of the six factors.
        seeds: (n,) in ascending order.
        errors: (n,) the metric, infinite where the run was lost.
        lost: (n,) whether it was.
        phases: whether they are phases of one recording.
    """

    combination: Combination
    seeds: IntArray
    errors: FloatArray
    lost: BoolArray
    phases: bool

    def only(self, places: IntArray) -> "Runs":
        """Return the runs at ``places``."""
        return Runs(self.combination, self.seeds[places], self.errors[places], self.lost[places], self.phases)


@dataclass(frozen=True, eq=False)
class Pair:
    """The runs of two combinations on the seeds that both have.

    Attributes:
        subject: values of the six factors.
        baseline: of what it is compared with.
        ratios: log ratios of the metric, subject over baseline; a lost run is the worst of all.
        lost: how many of the subject's runs, and of the baseline's, diverged or failed.
        runs: seeds that both have.
        replicate: "seed" or "phase".
    """

    subject: Combination
    baseline: Combination
    ratios: LogRatios
    lost: tuple[int, int]
    runs: int
    replicate: str

    @property
    def turned(self) -> "Pair":
        """The same with baseline and subject exchanged."""
        return replace(
            self, subject=self.baseline, baseline=self.subject, ratios=self.ratios.turned, lost=self.lost[::-1]
        )


def grouped(rows: "pd.DataFrame", metric: str) -> dict[Combination, Runs]:
    """Return the runs of each combination; the factors are text."""
    errors = np.where(rows["status"] == "ok", rows[metric].to_numpy(dtype=float), np.inf)
    seeds, ok = rows["seed"].to_numpy(), (rows["status"] == "ok").to_numpy()
    phases = (rows["replicate"] == "phase").to_numpy()
    rows_of: dict[Combination, list[int]] = {}
    for place, key in enumerate(zip(*(rows[factor].tolist() for factor in FACTORS), strict=True)):
        rows_of.setdefault(key, []).append(place)
    groups = {}
    for key, places in rows_of.items():
        order = np.array(places)[np.argsort(seeds[places], kind="stable")]
        groups[key] = Runs(key, seeds[order], errors[order], ~ok[order], bool(phases[order].any()))
    return groups


def paired(runs: Iterable[tuple[Runs, Runs]]) -> list[Pair]:
    """Return the runs of two combinations each, on the seeds that both have."""
    common = [on_common_seeds(ours, theirs) for ours, theirs in runs]
    ratios = log_ratios_of((ours.errors, theirs.errors) for ours, theirs in common)
    return [_pair(ours, theirs, own) for (ours, theirs), own in zip(common, ratios, strict=True)]


def _pair(ours: Runs, theirs: Runs, ratios: LogRatios) -> Pair:
    lost = int(ours.lost.sum()), int(theirs.lost.sum())
    replicate = "phase" if ours.phases else "seed"
    return Pair(ours.combination, theirs.combination, ratios, lost, len(ours.seeds), replicate)


def on_common_seeds(ours: Runs, theirs: Runs) -> tuple[Runs, Runs]:
    """Return the runs of both on the seeds that both have."""
    if len(ours.seeds) == len(theirs.seeds) and (ours.seeds == theirs.seeds).all():
        return ours, theirs
    _, first, second = np.intersect1d(ours.seeds, theirs.seeds, return_indices=True)
    return ours.only(first), theirs.only(second)
