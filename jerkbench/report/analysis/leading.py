"""The leaders of each group of rivals: those whom nobody was shown to beat."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.comparison import Comparison
from jerkbench.report.analysis.runs import Combination


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


def contest(rivals: Sequence[Combination], comparisons: Iterable[Comparison]) -> Contest:
    """Return who leads of ``rivals``; nobody does where nothing was compared."""
    comparisons = tuple(comparisons)
    beaten = {_loser(comparison) for comparison in comparisons}
    leaders = tuple(rival for rival in rivals if rival not in beaten) if comparisons else ()
    return Contest(tuple(rivals), leaders, comparisons)


def _loser(comparison: Comparison) -> Combination | None:
    """Return who was shown to be worse, or to lose more runs."""
    if comparison.verdict in {Verdict.BETTER, Verdict.FEWER_LOST}:
        return comparison.baseline
    return comparison.subject if comparison.shown else None
