"""Rows -> runs by combination and seed, the rule by which they are judged, and what each is held against."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.statistics.families import Correction
from jerkbench.evaluation.statistics.judgement import LEVEL, MARGIN
from jerkbench.renamed import new_label
from jerkbench.report.analysis.columns import FACTORS, Combination, numbers_of_rows, require_factors

if TYPE_CHECKING:
    import pandas as pd


FLOOR = "reference_floor_m"
"""The column with the floor that the reference's own sigma puts under a position RMSE."""


class MethodRuns(NamedTuple):
    """The runs of one combination.

    Attributes:
        combination: values of the six factors.
        seeds: (n,) in ascending order.
        errors: (n,) the metric, infinite where the run was lost.
        lost: (n,) whether it was.
        phases: whether they are phases of one recording.
        floor: of the metric, by the reference's own sigma; 0: not known.
    """

    combination: Combination
    seeds: IntArray
    errors: FloatArray
    lost: BoolArray
    phases: bool
    floor: float = 0.0

    def only(self, places: IntArray) -> "MethodRuns":
        """Return the runs at ``places``."""
        chosen = self.seeds[places], self.errors[places], self.lost[places]
        return MethodRuns(self.combination, *chosen, self.phases, self.floor)

    @property
    def typical(self) -> float:
        """The root mean square of the errors."""
        with np.errstate(over="ignore"):
            return float(np.sqrt(np.mean(self.errors**2))) if len(self.errors) else np.nan


def runs_by_combination(rows: "pd.DataFrame", metric: str) -> dict[Combination, MethodRuns]:
    """Return the runs of each combination; the factors are text."""
    errors = np.where(rows["status"] == "ok", rows[metric].to_numpy(dtype=float), np.inf)
    seeds, ok = rows["seed"].to_numpy(), (rows["status"] == "ok").to_numpy()
    phases = (rows["replicate"] == "phase").to_numpy()
    floored = metric == "position_rmse_m" and FLOOR in rows
    floors = rows[FLOOR].to_numpy(dtype=float) if floored else np.zeros(len(rows))
    groups = {}
    for values, places in numbers_of_rows(rows, FACTORS).items():
        key, order = Combination(*values), places[np.argsort(seeds[places], kind="stable")]
        floor = float(np.nan_to_num(floors[order]).max(initial=0.0))
        groups[key] = MethodRuns(key, seeds[order], errors[order], ~ok[order], bool(phases[order].any()), floor)
    return groups


def on_common_seeds(ours: MethodRuns, theirs: MethodRuns) -> tuple[MethodRuns, MethodRuns]:
    """Return the runs of both on the seeds that both have."""
    if len(ours.seeds) == len(theirs.seeds) and (ours.seeds == theirs.seeds).all():
        return ours, theirs
    _, first, second = np.intersect1d(ours.seeds, theirs.seeds, return_indices=True)
    return ours.only(first), theirs.only(second)


# The rule by which the comparisons of a study are judged.


@dataclass(frozen=True)
class VerdictRule:
    """How the comparisons of a study are judged; see `jerkbench.evaluation.statistics.judgement.judged`.

    Attributes:
        margin: ratios up to 1 + margin are equal for every practical purpose.
        correction: what 5 % are 5 % of: studies with any wrong sentence, or sentences.
        level: these 5 %, or what a look at seeds that were added in blocks may spend of them.
    """

    margin: float = MARGIN
    correction: Correction = Correction.MAX_T
    level: float = LEVEL

    def __post_init__(self) -> None:
        """Check the margin.

        Raises:
            JerkbenchError: it is below 0.
        """
        if self.margin < 0:
            raise JerkbenchError(f"The margin of equality is {100 * self.margin:g} %; give 0 or more, for example 3.")

    @property
    def equal(self) -> str:
        """What two methods are whose ratio is within the margin."""
        return f"equal within {100 * self.margin:g} %"

    def of(self, rows: "pd.DataFrame") -> "VerdictRule":
        """Return the rule for the rows of a study, which know what their last look may spend."""
        return replace(self, level=min(self.level, rows.attrs.get(SPENDS, self.level)))


RULE = VerdictRule()

SPENDS = "level"
"""Among the attributes of a study's rows: see `Rule.level`."""


# The combination that each one is held against: like it but for some factors.


def parse_baseline(text: str) -> dict[str, str]:
    """Read ``factor=value[;factor=value]`` (a comma does as well, where no value has one).

    Raises:
        JerkbenchError: it is not of that form, or names no factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    values = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        require_factors([key])
        values[key] = new_label(key, value)
    return values


def partners(
    combinations: Collection[Combination], baseline: Mapping[str, str]
) -> list[tuple[Combination, Combination]]:
    """Return every combination with the one that is like it but for the factors of ``baseline``.

    What has no such partner, or is the partner itself, is left out.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    pairs = [(key, key._replace(**baseline)) for key in combinations]
    if not any(partner in combinations for _, partner in pairs):
        labels = {factor: {getattr(key, factor) for key in combinations} for factor in FACTORS}
        key, value = next(((k, v) for k, v in baseline.items() if v not in labels[k]), next(iter(baseline.items())))
        if value not in labels[key]:
            raise JerkbenchError(unknown(key, value, labels[key]))
        factors = ", ".join(f"{k}={v}" for k, v in baseline.items())
        raise JerkbenchError(
            f"No combination has {factors} together; `jerkbench table DIR` shows those that there are."
        )
    return [(key, partner) for key, partner in pairs if partner in combinations and partner != key]
