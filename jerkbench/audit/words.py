"""The answer of an audit in sentences, each from its numbers."""

from collections import Counter
from collections.abc import Iterable, Sequence

import pandas as pd

from jerkbench.audit.answer import NO_FAULT, AuditAnswer, leaders, reweighted
from jerkbench.audit.protocol import PUBLISHED
from jerkbench.audit.stored import AuditRows
from jerkbench.evaluation.statistics.drives_and_tunings import MARGIN, Statement, Statements
from jerkbench.evaluation.statistics.judgement import Verdict

EQUAL = f"equal within {100 * MARGIN:.0f} %"


def three_sentences(answer: AuditAnswer) -> list[str]:
    """Return the answer: how many beat the plain filter, what the best of them brings, what it costs."""
    said, methods, tunings = answer.said, answer.methods, answer.rows.protocol.tunings
    n, published = len(methods), methods[methods["is"].isin(PUBLISHED)]
    own, best, theirs = counts(said.own_plain), counts(said.best_plain), counts_of(published["own_verdict"])
    price = counts_of(methods["no_fault_verdict"])
    ((leader, times),) = Counter(leaders(answer.rows)).most_common(1)
    first = (
        f"**{theirs['better']} of {len(published)} published adaptive filters beat the plain filter of their model,"
        f" tuned alike; {theirs['worse']} are worse**. For the others, nothing is shown. The average one has"
        f" {interval(said.average)} of the error of the plain filter. With our own methods, {own['better']} of {n} are"
        f" better and {own['worse']} worse."
    )
    second = (
        f"**Against the best plain filter of any model, {best['better']} of {n} are better and {best['worse']} worse**."
        " The published method that leads in tuning has"
        f" {interval(said.pick)} of its error, with as many settings tried. It is {leader} in {times} of"
        f" {tunings} tunings."
    )
    third = (
        f"**It pays under {_where(answer)}; without a fault, {_count(price['better'])} better and {price['worse']} are"
        " worse**. The median method is more than 3 % worse than its plain filter on"
        f" {percent(methods['worse_3'].median())} of the drives, and more than twice as bad on"
        f" {percent(methods['worse_100'].median())}."
    )
    return [first, second, third]


def _where(answer: AuditAnswer) -> str:
    """Say under which kinds of faults most methods are better, and how many."""
    faults = answer.kinds[answer.kinds["kind"] != NO_FAULT]
    better = faults[faults["verdict"].astype(str) == str(Verdict.BETTER)].groupby("kind", observed=True).size()
    told = [f"{str(kind).replace('_', ' ')} ({count})" for kind, count in better.nlargest(3).items()]
    return ", ".join(told) or "no kind of fault for sure"


def _count(count: int) -> str:
    return "none is" if count == 0 else "1 is" if count == 1 else f"{count} are"


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
