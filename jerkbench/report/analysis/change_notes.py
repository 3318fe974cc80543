"""The sentences below two sets of results: how they were judged, and where others lead."""

from collections.abc import Iterable, Sequence

from jerkbench.evaluation.statistics.families import Correction
from jerkbench.report.analysis.changes import Change
from jerkbench.report.analysis.standings import Standing

ON_THE_SAME = (
    "On the same seeds: at most 5 % of such sets have any wrong verdict (largest studentised mean log ratio of "
    "{count}, bootstrap over the seeds)."
)
BY_SENTENCE = "On the same seeds: of the verdicts 5 % may be wrong (Benjamini and Hochberg over {count})."
ON_OTHERS = (
    "On other seeds: at most 5 % of such sets have any wrong verdict (largest studentised difference of the mean "
    "logarithms of {count}, bootstrap over the seeds of A and those of B); they show much less than the same seeds."
)


def notes_of_tests(changed: Iterable[Change]) -> list[str]:
    """Return by what test the verdicts on the same seeds were found, and by what those on others."""
    tested = [change for change in changed if not change.phases]
    same, others = ([change for change in tested if change.paired is paired] for paired in (True, False))
    by_sentence = bool(same) and same[0].rule.correction is Correction.FDR
    families = ((BY_SENTENCE if by_sentence else ON_THE_SAME, same), (ON_OTHERS, others))
    return [words.format(count=len(family)) for words, family in families if family]


def other_leaders(first: Sequence[Standing], second: Sequence[Standing]) -> list[str]:
    """Return a sentence for each scenario of both sets in which others lead in the second."""
    before = {standing.scenario: standing.leaders for standing in first if standing.contest.decided}
    notes = []
    for standing in second:
        leaders = before.get(standing.scenario)
        if leaders is None or not standing.contest.decided or set(leaders) == set(standing.leaders):
            continue
        where = f"On {', '.join(standing.scenario)}" if standing.scenario else "In the lead"
        notes.append(f"{where}: {', '.join(leaders)} in A, {', '.join(standing.leaders)} in B.")
    return notes
