"""The answer of an audit in sentences, each from the verdicts."""

from collections.abc import Sequence

from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import MethodVerdict
from jerkbench.evaluation.statistics.judgement import Verdict


def last_line(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Return the answer to the audit's question, in one line."""
    better = [verdict for verdict in verdicts if verdict.verdict is Verdict.BETTER]
    harmless = [verdict for verdict in better if verdict.worst_ratio <= 1 + protocol.margin]
    percent = f"{100 * protocol.margin:g} %"
    return (
        f"{len(better)} of {len(verdicts)} beat a tuned Kalman filter; {len(harmless)} of them harm nowhere by more"
        f" than {percent}."
    )


def sentences(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol, tuning: str) -> list[str]:
    """Return what a practitioner should know first, the most important first.

    Args:
        verdicts: of every method.
        protocol: of the audit.
        tuning: what tuning alone does to the plain filter, in a sentence.
    """
    return [
        f"{last_line(verdicts, protocol)} {_alone(verdicts)} {tuning}",
        *_best(verdicts),
        f"{_price(verdicts, protocol)} {_harmless(verdicts, protocol)}",
        *_defaults(verdicts),
        *_luck(verdicts),
    ]


def _alone(verdicts: Sequence[MethodVerdict]) -> str:
    """Say what intervals of single methods show, which nobody may pick the best of."""
    names = [verdict.method.name for verdict in verdicts if verdict.tuned.high < 1]
    which = f": {', '.join(names)}" if names else ""
    return f"That holds for all methods at once; by its own 95 % interval {len(names)} would{which}."


def _best(verdicts: Sequence[MethodVerdict]) -> list[str]:
    best = min(verdicts, key=lambda verdict: verdict.tuned.ratio)
    interval = f"95 % over families {best.tuned.low:.2f} to {best.tuned.high:.2f}"
    worst = f"its worst scenario is {best.worst} with {best.worst_ratio:.2f}"
    lowest = f"The lowest ratio to the tuned plain filter has {best.method.name}: {best.tuned.ratio:.2f}"
    return [f"{lowest} ({interval}); {worst}."]


def _price(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    dear = [verdict for verdict in verdicts if verdict.nominal > 1 + protocol.margin]
    advice = ": adapt only where a fault is expected" if 2 * len(dear) > len(verdicts) else ""
    percent = f"{100 * protocol.margin:g} %"
    return f"Where nothing is wrong {len(dear)} of {len(verdicts)} cost more than {percent}, tuned{advice}."


def _harmless(verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> str:
    """Say how many harm nowhere, whatever their mean: that can be, where none is shown to be better."""
    harmless = [verdict for verdict in verdicts if verdict.worst_ratio <= 1 + protocol.margin]
    middle = sorted(verdict.worst_ratio for verdict in verdicts)[len(verdicts) // 2]
    return (
        f"Whatever their mean, {len(harmless)} of {len(verdicts)} harm in no scenario by more than"
        f" {100 * protocol.margin:g} %; the one in the middle is {middle:.1f} times worse than plain where it is worst."
    )


def _defaults(verdicts: Sequence[MethodVerdict]) -> list[str]:
    better = sum(verdict.default < 1 for verdict in verdicts)
    changed = sum((verdict.default < 1) != (verdict.tuned.ratio < 1) for verdict in verdicts)
    return [
        f"At their defaults {better} of {len(verdicts)} are ahead of the tuned plain filter; tuning turns {changed}."
    ]


def _luck(verdicts: Sequence[MethodVerdict]) -> list[str]:
    spread = max(verdict.restarts[1] / verdict.restarts[0] for verdict in verdicts)
    return [f"Between the restarts of a search the ratio of one method differs by up to {100 * (spread - 1):.0f} %."]
