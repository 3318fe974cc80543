"""The answer of an audit in sentences, each from its numbers."""

from collections import Counter
from collections.abc import Iterable, Sequence

import pandas as pd

from jerkbench.audit.answer import NO_FAULT, AuditAnswer, kinds_of, leaders, reweighted
from jerkbench.audit.protocol import PUBLISHED
from jerkbench.audit.stored import AuditRows
from jerkbench.evaluation.statistics.drives_and_tunings import MARGIN, Statement, Statements, comparisons
from jerkbench.evaluation.statistics.judgement import Verdict

EQUAL = f"equal within {100 * MARGIN:.0f} %"


def three_sentences(answer: AuditAnswer) -> list[str]:
    """Return the answer: how many beat the plain filter, where the gain comes from, what picking the best brings."""
    said, methods = answer.said, answer.methods
    taken, as_published = methods[methods["is"].isin(PUBLISHED)], methods[methods["is"] == "published"]
    theirs, exact = counts_of(taken["own_verdict"]), counts_of(as_published["own_verdict"])
    best, price = counts(said.best_plain), counts_of(methods["no_fault_verdict"])
    n, leading = len(methods), len(set(leaders(answer.rows)))
    first = (
        f"**{theirs['better']} of {len(taken)} adaptive filters beat the plain filter of their model, tuned alike;"
        f" {theirs['worse']} are worse**. These are {taken['adaptation'].nunique()} adaptations, published or"
        f" simplified, on {taken['filter'].nunique()} models. Of the {len(as_published)} that are as published,"
        f" {exact['better']} are better and {exact['worse']} worse. The average has {interval(said.average)} of the"
        f" error. Against the best plain filter of any model, {best['better']} of {n} are better and {best['worse']}"
        " worse."
    )
    third = (
        f"**Taking whichever of these leads in tuning gives {interval(said.pick)}** of the error of a plain filter that"
        " was chosen from as many settings. The leader changes:"
        f" {leading} different ones in {answer.rows.protocol.tunings} tunings. A typical method is more than 3 % worse"
        f" than its plain filter on {percent(methods['worse_3'].median())} of the drives."
    )
    price_text = f"Without a fault, {price['better']} are better and {price['worse']} worse."
    return [first, f"{_where(answer)} {price_text}", third]


def _where(answer: AuditAnswer) -> str:
    """Say which kind of fault the average gains most from, what is left without it, and which one does most harm."""
    rows, n = answer.rows, len(answer.methods)
    average, drives = comparisons(answer.losses)[0][0].mean(axis=0), kinds_of(rows)
    left = {kind: average[~member].mean() for kind, member in drives.items() if kind != NO_FAULT and member.any()}
    most = max(left, key=lambda kind: left[kind])
    said = reweighted(rows, f"{most}=0")
    own, share = counts(said.own_plain), percent(drives[most].mean())
    shown = {kind: counts_of(of["verdict"]) for kind, of in answer.kinds.groupby("kind", observed=True)}
    harm = max((kind for kind in shown if kind not in (most, NO_FAULT)), key=lambda kind: shown[kind]["worse"])
    name, other = most.replace("_", " "), str(harm).replace("_", " ")
    return (
        f"**Most of the gain comes from {name}**. Without the {share} of drives that have {name}, the average has"
        f" {interval(said.average)}, with {own['better']} methods better and {own['worse']} worse. With {name},"
        f" {shown[most]['better']} of {n} are better and {shown[most]['worse']} worse; with {other},"
        f" {shown[harm]['better']} and {shown[harm]['worse']}."
    )


def counts(said: Sequence[Statement]) -> dict[str, int]:
    """Return how many statements have each verdict."""
    return counts_of(one.verdict for one in said)


def counts_of(verdicts: Iterable[object]) -> dict[str, int]:
    """Return how many are better, worse, equal and undecided."""
    known = Counter(map(str, verdicts))
    return {str(word): known[word] for word in (Verdict.BETTER, Verdict.WORSE, Verdict.EQUAL, Verdict.UNDECIDED)}


def interval(said: Statement) -> str:
    """Say a ratio with its interval and its verdict."""
    less = ", by less than 10 %" if said.small and said.verdict is not Verdict.EQUAL else ""
    word = EQUAL if said.verdict is Verdict.EQUAL else f"{said.verdict}{less}"
    return f"{said.ratio:.2f} [{said.low:.2f}, {said.high:.2f}] ({word})"


def percent(share: float) -> str:
    """Say a share."""
    return f"{100 * share:.0f} %"


def reweighted_text(rows: AuditRows, mixture: str) -> str:
    """Say what the audit would say of another mixture."""
    said = reweighted(rows, mixture)
    own, best = (
        ", ".join(f"{count} {word}" for word, count in counts(of).items()) for of in (said.own_plain, said.best_plain)
    )
    lines = [
        f"With {mixture}, from {rows.protocol.judged_drives} drives of protocol {rows.protocol.digest}, weighted:",
        f"- the average published adaptation has {interval(said.average)} of the error of its plain filter;",
        f"- the one that leads in tuning has {interval(said.pick)} of that of the best plain filter;",
        f"- against the plain filter of its model: {own};",
        f"- against the best plain filter: {best}.",
    ]
    both = zip(rows.protocol.methods, said.own_plain, strict=True)
    shown = [f"  {method.name}: {interval(one)}" for method, one in both if one.verdict is not Verdict.UNDECIDED]
    return "\n".join([*lines, *shown])


def compared_text(changed: pd.DataFrame, statements: int, first: Statements, second: Statements) -> str:
    """Say how many verdicts two audits do not share; one that turns from better to worse is a defect."""
    turned = changed[changed[["first", "second"]].isin([str(Verdict.BETTER), str(Verdict.WORSE)]).all(axis=1)]
    head = (
        f"An audit with other drives and other tunings changes {len(changed)} of {statements} verdicts; {len(turned)}"
        f" turn from better to worse or back{', which is a defect' if len(turned) else ''}."
    )
    tail = (
        f"The average published adaptation had {interval(first.average)}, then {interval(second.average)}. The one"
        f" that leads in tuning had {interval(first.pick)}, then {interval(second.pick)}."
    )
    lines = [
        f"- {row.filter} + {row.adaptation}, {row.against} plain filter: {row.first}, then {row.second}"
        for row in turned.itertuples()
    ]
    return "\n".join([f"{head} {tail}", *lines])
