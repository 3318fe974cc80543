"""The rule by which the comparisons of a study are judged."""

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.families import Correction
from jerkbench.evaluation.statistics.judgement import LEVEL, MARGIN

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Rule:
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

    def of(self, rows: "pd.DataFrame") -> "Rule":
        """Return the rule for the rows of a study, which know what their last look may spend."""
        return dataclasses.replace(self, level=min(self.level, rows.attrs.get(SPENDS, self.level)))


RULE = Rule()

SPENDS = "level"
"""Among the attributes of a study's rows: see `Rule.level`."""
