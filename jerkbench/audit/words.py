"""The answer of an audit in sentences, each from its numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from jerkbench.audit.answer import NO_FAULT, Answer, reweighted
from jerkbench.audit.campaign import picks
from jerkbench.audit.stored import AuditRows
from jerkbench.evaluation.statistics.drives_and_tunings import MARGIN, Statement, Statements
from jerkbench.evaluation.statistics.judgement import LEVEL, Verdict

EQUAL = f"equal within {MARGIN:.0%}".replace("%", " %")


def three_sentences(answer: Answer) -> list[str]:
    """Return the answer: how many beat the plain filter, what the best of them brings, what it costs."""
    protocol, said, methods = answer.rows.protocol, answer.said, answer.methods
    n = len(methods)
    own, best = counts(said.own_plain), counts(said.best_plain)
    price = counts_of(methods["no_fault_verdict"])
    name, times = _picked(answer.rows)
    first = (
        f"**Of {n} adaptive filters, {own['better']} are shown to beat the plain filter of their model, tuned alike;"
        f" {own['worse']} are worse, {own['equal']} {EQUAL}.** Of the other {own['undecided']} nothing is shown."
        f" The average published adaptation has {interval(said.average)} of the error of its plain filter."
    )
    second = (
        f"**Against the best plain filter of any model, {best['better']} are better and {best['worse']} worse.**"
        f" Whichever published method leads in tuning ({name}, {times} of {protocol.tunings} times) has"
        f" {interval(said.pick)} of the error of the best plain filter with as many settings tried."
    )
    third = (
        f"**The price: without a fault, {price['worse']} of {n} are worse and {price['better']} better.**"
        f" The median method is worse than its plain filter by more than 3 % in"
        f" {percent(methods['worse_3'].median())} of the drives, and has more than twice its error in"
        f" {percent(methods['worse_100'].median())}."
    )
    return [first, second, third]


def counts(said: Sequence[Statement]) -> dict[str, int]:
    """Return how many statements have each verdict."""
    return counts_of(str(one.verdict) for one in said)


def counts_of(verdicts: Any) -> dict[str, int]:  # noqa: ANN401 - texts
    """Return how many are better, worse, equal and undecided."""
    known = Counter(map(str, verdicts))
    return {str(word): known[str(word)] for word in (Verdict.BETTER, Verdict.WORSE, Verdict.EQUAL, Verdict.UNDECIDED)}


def _picked(rows: AuditRows) -> tuple[str, int]:
    """Which published method leads on the tuning drives most often, and how often."""
    protocol, found = rows.protocol, picks(rows.protocol, rows.tuned)
    published = {name for name, kind in protocol.adaptations.items() if kind != "own"}
    own = found[found["adaptation"].isin(published) & found["filter"].isin(protocol.filters)]
    leads = own.loc[own.groupby("tuning")["loss"].idxmin()]
    ((name, times),) = Counter(leads["filter"].astype(str) + " + " + leads["adaptation"].astype(str)).most_common(1)
    return name, times


def interval(said: Statement) -> str:
    """Say a ratio with its interval and its verdict."""
    less = ", by less than 10 %" if said.small and said.verdict is not Verdict.EQUAL else ""
    word = EQUAL if said.verdict is Verdict.EQUAL else f"{said.verdict}{less}"
    return f"{said.ratio:.2f} [{said.low:.2f}, {said.high:.2f}] ({word})"


def percent(share: float) -> str:
    """Say a share."""
    return f"{100 * share:.0f} %"


def cost_sentences(answer: Answer) -> list[str]:
    """Say what changes where a lost run costs more or less."""
    lines = []
    for cost, said in answer.at_costs.items():
        own, best = counts(said.own_plain), counts(said.best_plain)
        lines.append(
            f"Where a lost run costs {cost:g} times, {own['better']} are better and {own['worse']} worse than the plain"
            f" filter of their model, {best['better']} and {best['worse']} than the best one. The average has"
            f" {interval(said.average)}, the one that leads in tuning {interval(said.pick)}."
        )
    return lines


def error_sentence(answer: Answer) -> str:
    """Say how often the whole procedure errs."""
    error = answer.error
    return (
        f"We drew {error.audits} audits from these rows, centred so that no method differs. In {error.wrong} of them"
        f" some statement was false. The lower 95 % bound of that share is {error.low:.3f}, and"
        f" {'keeps' if error.low <= LEVEL else 'breaks'} the promised {LEVEL:g}."
    )


def steps_table(answer: Answer) -> list[tuple[str, float]]:
    """Return what each step brings: the error relative to the first filter at its defaults, without adaptation."""
    losses, rows = answer.losses, answer.rows
    level = rows.drives.set_index("seed")["level"].loc[list(rows.protocol.seeds_to_judge_on)].to_numpy()
    plain = np.exp((losses.plains - level).mean(axis=(1, 2)))
    best = losses.plains[np.argmin(losses.tuned_plains, axis=0), np.arange(losses.plains.shape[1])]
    first = rows.protocol.filters[0]
    adapted = np.exp((losses.methods[losses.averaged] - level).mean())
    return [
        (f"{first}, tuned", float(plain[0])),
        ("the best model for these drives, tuned", float(np.exp((best - level).mean()))),
        ("a published adaptation, average over all and over the models, tuned", float(adapted)),
    ]


def reweighted_text(rows: AuditRows, mixture: str) -> str:
    """Say what the audit would say of another mixture."""
    said = reweighted(rows, mixture)
    own, best = counts(said.own_plain), counts(said.best_plain)
    lines = [
        f"With {mixture}, from {rows.protocol.judged_drives} drives of protocol {rows.protocol.digest}, weighted:",
        f"- the average published adaptation has {interval(said.average)} of the error of its plain filter;",
        f"- the one that leads in tuning has {interval(said.pick)} of that of the best plain filter;",
        f"- against the plain filter of its model: {_told(own)};",
        f"- against the best plain filter: {_told(best)}.",
    ]
    shown = [
        f"  {method.name}: {interval(one)}"
        for method, one in zip(rows.protocol.methods, said.own_plain, strict=True)
        if one.verdict is not Verdict.UNDECIDED
    ]
    return "\n".join([*lines, *shown])


def _told(known: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {word}" for word, count in known.items())


def compared_text(changed: pd.DataFrame, statements: int, first: Statements, second: Statements) -> str:
    """Say how many verdicts two audits do not share; one that turns from better to worse is a defect."""
    turned = changed[changed[["first", "second"]].isin([str(Verdict.BETTER), str(Verdict.WORSE)]).all(axis=1)]
    lines = [
        f"- {row.filter} + {row.adaptation}, {row.against} plain filter: {row.first}, then {row.second}"
        for row in turned.itertuples()
    ]
    head = (
        f"An audit with other drives and other tunings changes {len(changed)} of {statements} verdicts; {len(turned)}"
        f" turn from better to worse or back{', which is a defect' if lines else ''}."
    )
    tail = (
        f"The average published adaptation had {interval(first.average)}, then {interval(second.average)}. The one"
        f" that leads in tuning had {interval(first.pick)}, then {interval(second.pick)}."
    )
    return "\n".join([f"{head} {tail}", *lines])


def take_lines(take: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return the table of what to take, as cells."""
    ratios = [f"{row.ratio:.2f} [{row.low:.2f}, {row.high:.2f}]" for row in take.itertuples()]
    return list(zip(take["when"].str.replace("_", " "), take["take"], ratios, take["drives"].astype(str), strict=True))


def price_sentences(answer: Answer) -> list[str]:
    """Say what adapting costs where nothing is wrong, and from which share of faulty drives on it pays."""
    methods = answer.methods
    price, pays = methods["no_fault_ratio"], methods["pays_from"]
    later, lines = pays[pays > 0], []
    if price.notna().any():
        dearest = _name(methods, int(price.argmax()))
        lines.append(
            f"Without a fault, the median method has {price.median():.2f} times the error of its plain filter. The"
            f" dearest is {dearest} with {price.max():.2f}."
        )
    always = (
        f"{int((pays == 0).sum())} of {len(methods)} have the smaller mean error whatever the share of faulty drives,"
        f" and {int(pays.isna().sum())} have it with no share."
    )
    some = f" The other {len(later)} pay from a share of {percent(later.median())} on (median)." if len(later) else ""
    return [*lines, always + some]


def _name(table: pd.DataFrame, place: int) -> str:
    row = table.iloc[place]
    return f"{row['filter']} + {row['adaptation']}"


def kind_lines(answer: Answer) -> list[tuple[str, ...]]:
    """Return for each kind of fault: drives, methods better and worse, the lowest and the highest ratio, as cells."""
    lines = []
    for kind, own in answer.kinds.groupby("kind", sort=False):
        shown, ratio = counts_of(own["verdict"]), own["ratio"]
        ends = [f"{_name(own, int(place))} {ratio.iloc[place]:.2f}" for place in (ratio.argmin(), ratio.argmax())]
        drives = str(own["drives"].iloc[0])
        lines.append((str(kind).replace("_", " "), drives, str(shown["better"]), str(shown["worse"]), *ends))
    return sorted(lines, key=lambda line: (line[0] != NO_FAULT, -int(line[2])))
