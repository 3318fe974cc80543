"""Who leads: in each group of rivals those whom nobody was shown to beat."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.comparison import RULE, Combination, Comparison, Rule, Runs, judged_pairs, paired
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.references import competes

MOST_PAIRS = 50_000
"""More comparisons than these take minutes, and show little."""


@dataclass(frozen=True, eq=False)
class Contest:
    """A group of rivals.

    Attributes:
        rivals: their combinations.
        leaders: those whom nobody was shown to beat.
        comparisons: of every two.
    """

    rivals: tuple[Combination, ...]
    leaders: tuple[Combination, ...]
    comparisons: tuple[Comparison, ...]

    @property
    def decided(self) -> bool:
        """Whether the leaders are fewer than the rivals: else nothing was shown."""
        return 0 < len(self.leaders) < len(self.rivals)


def contests(
    groups: Mapping[Combination, Runs],
    rivals: Iterable[Sequence[Combination]],
    rule: Rule = RULE,
    most: int = MOST_PAIRS,
) -> list[Contest]:
    """Return who leads each group of ``rivals``, all pairs of all groups as one family.

    Nobody leads where there are more than ``most`` pairs, or none.

    Args:
        groups: runs of each combination.
        rivals: the combinations of each group.
        rule: how to judge.
        most: pairs that are tested.
    """
    fields = [tuple(one for one in group if competes(dict(zip(FACTORS, one, strict=True)))) for group in rivals]
    pairs = [list(itertools.combinations(field, 2)) for field in fields]
    if sum(map(len, pairs)) > most:
        return [Contest(field, (), ()) for field in fields]
    judged = iter(judged_pairs((paired(groups[a], groups[b]) for pair in pairs for a, b in pair), rule))
    found = []
    for field, pair in zip(fields, pairs, strict=True):
        comparisons = tuple(itertools.islice(judged, len(pair)))
        beaten = {_loser(one) for one in comparisons}
        found.append(Contest(field, tuple(one for one in field if one not in beaten), comparisons))
    return found


def _loser(one: Comparison) -> Combination | None:
    """Return who was shown to be worse, or to lose more runs."""
    if one.verdict in {Verdict.BETTER, Verdict.FEWER_LOST}:
        return one.baseline
    return one.subject if one.shown else None
