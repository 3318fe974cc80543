"""What the rows of an audit say, in numbers and sentences, and the folder of an audit."""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.audit.protocol import PUBLISHED, AuditMethod
from jerkbench.audit.runs import (
    AuditRows,
    cubes,
    defaults,
    losses_of,
    lost_shares,
    read_audit_manifest,
    read_rows,
)
from jerkbench.errors import JerkbenchError, PluginError, unknown
from jerkbench.evaluation.drives_and_tunings import (
    SMALL_MARGIN,
    Error,
    Losses,
    Statement,
    Statements,
    comparisons,
    mixture_weights,
    picked,
    procedure_error,
    stated,
    statements,
)
from jerkbench.evaluation.intervals import share_interval
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import filled_template, write_text
from jerkbench.parameters import provenance_of

FAULT = "drawn.fault."
"""Columns of drives that tell a kind of fault begin so."""
NO_FAULT, FAULTY = "no fault", "faulty"
NOTHING_KNOWN, LEAST_BAD = "nothing known", "the worst kind shall be least bad"
FEWEST_DRIVES = 5
"""Drives of a kind of which a ratio is told: fewer have no interval worth the name."""
WORSE = {"worse_3": 1.03, "worse_100": 2.0}
"""Ratios above which a single drive counts as worse, by the name of the column."""


@dataclass(frozen=True)
class AuditAnswer:
    """What an audit says.

    Attributes:
        rows: from which all follows.
        losses: log errors by method, tuning and drive.
        said: the three families of hypotheses.
        methods: a method a row; the lowest ratio to the plain filter of its model first.
        kinds: a method and a kind of fault a row.
        apart: an estimator that is shown apart a row.
        take: a situation a row: which method to take.
        error: of the whole procedure.
    """

    rows: AuditRows
    losses: Losses
    said: Statements
    methods: pd.DataFrame
    kinds: pd.DataFrame
    apart: pd.DataFrame
    take: pd.DataFrame
    error: Error

    @cached_property
    def sentences(self) -> list[str]:
        """The answer: how many beat the plain filter, where the gain comes from, what picking the best brings."""
        rows, losses, methods = self.rows, self.losses, self.methods
        most = main_kind(rows, losses)
        kinds = {str(kind): counts_of(of["verdict"]) for kind, of in self.kinds.groupby("kind", observed=True)}
        text = worded(
            PAGE_TEMPLATES / "answer.md.jinja",
            said=self.said,
            methods=methods,
            taken=methods[methods["is"].isin(PUBLISHED)],
            as_published=methods[methods["is"] == "published"],
            most=most,
            share=kinds_of(rows)[most].mean(),
            without=reweighted(rows, losses, f"{most}=0"),
            kinds=kinds,
            harm=max((kind for kind in kinds if kind not in (most, NO_FAULT)), key=lambda kind: kinds[kind]["worse"]),
            leaders=leaders(rows, losses),
        )
        return [" ".join(sentence.split()) for sentence in text.split("\n\n")]


def answered(rows: AuditRows) -> AuditAnswer:
    """Return what the rows of an audit say."""
    protocol, losses = rows.protocol, losses_of(rows)
    said = statements(losses)
    own = comparisons(losses)[2]
    kinds = kind_frame(own, [method._asdict() for method in protocol.methods], rows)
    return AuditAnswer(
        rows=rows,
        losses=losses,
        said=said,
        methods=method_frame(rows, losses, said, kinds),
        kinds=kinds,
        apart=apart_frame(rows),
        take=take_frame(rows, losses),
        error=procedure_error(losses, protocol.resampled_audits),
    )


def reweighted(rows: AuditRows, losses: Losses, mixture: str) -> Statements:
    """Return what an audit would say of another mixture: ``faulty=0.05``, or a kind of fault in place of "faulty".

    Raises:
        PluginError: there is no such kind, or its share cannot be that.
    """
    name, _, share = mixture.partition("=")
    drives = kinds_of(rows)
    member = ~drives[NO_FAULT] if name == FAULTY else drives.get(name)
    if member is None:
        raise PluginError(unknown("kind of fault", name, [FAULTY, *drives]))
    try:
        wanted = float(share)
    except ValueError:
        raise PluginError(f"'{mixture}' gives no share; write for example {name}=0.05.") from None
    return statements(losses, mixture_weights(member, wanted))


def kinds_of(rows: AuditRows) -> dict[str, BoolArray]:
    """Return which of the judged drives (D,) have no fault, and which have each kind; a drive may have several."""
    judged = rows.drives.set_index("seed").loc[list(rows.protocol.seeds_to_judge_on)]
    columns = judged.reindex(columns=[FAULT + str(kind) for kind, *_ in rows.protocol.laws["faults"]]).notna()
    drives = {str(name).removeprefix(FAULT): own.to_numpy() for name, own in columns.items()}
    return {NO_FAULT: ~columns.any(axis=1).to_numpy(), **drives}


# Under each kind of fault.


def kind_frame(y: FloatArray, names: Sequence[Mapping[str, str]], rows: AuditRows) -> pd.DataFrame:
    """Return the ratio of each of y (k, R, D) under each kind of fault; the intervals hold for all of them at once.

    A kind of which too few drives were drawn is left out.
    """
    known = {kind: drives for kind, drives in kinds_of(rows).items() if drives.sum() >= FEWEST_DRIVES}
    level = LEVEL / (len(y) * len(known)) if known else LEVEL
    return pd.DataFrame(
        [
            {**name, "kind": kind, "drives": int(drives.sum()), **numbers_of(said)}
            for kind, drives in known.items()
            for name, said in zip(names, stated(y[:, :, drives], level), strict=True)
        ],
        columns=[*names[0], "kind", "drives", *numbers_of(_NOTHING)],
    )


def numbers_of(said: Statement, prefix: str = "") -> dict[str, object]:
    """Return a statement as columns."""
    own = {"ratio": said.ratio, "low": said.low, "high": said.high, "verdict": str(said.verdict), "small": said.small}
    return {prefix + name: value for name, value in own.items()}


_NOTHING = Statement(np.nan, np.nan, np.nan, Verdict.UNDECIDED, small=False, tuning_sd=np.nan)
"""Said where there is nothing to say."""


# Of each method.


def method_frame(rows: AuditRows, losses: Losses, said: Statements, kinds: pd.DataFrame) -> pd.DataFrame:
    """Return a method a row.

    Returns:
        filter, adaptation; is, source (what it is); own_*, best_* (against the plain filter of its model and the best
        one); untuned; no_fault_* ; better_kinds, worse_kinds; worst_kind, worst_ratio, worst_high; pays_from (share of
        faulty drives); worse_3, worse_100 with _low and _high (share of drives where it is worse by 3 % and by 100 %);
        lost (share of runs).
    """
    protocol, (_, _, own, _) = rows.protocol, comparisons(losses)
    plain = losses.plains[losses.model].mean(axis=1)
    untuned = np.exp((defaults(rows, protocol.methods) - plain).mean(axis=1))
    table = pd.DataFrame(
        [
            {**method._asdict(), **what_it_is(method), **numbers_of(mine, "own_"), **numbers_of(best, "best_")}
            for method, mine, best in zip(protocol.methods, said.own_plain, said.best_plain, strict=True)
        ]
    ).assign(untuned=untuned, tuning_sd=[one.tuning_sd for one in said.own_plain])
    of_method = [kinds[(kinds[["filter", "adaptation"]] == list(method)).all(axis=1)] for method in protocol.methods]
    table = table.join(pd.DataFrame([_over_kinds(each) for each in of_method]))
    table["pays_from"] = pays_from(own.mean(axis=1), kinds_of(rows)[NO_FAULT])
    for name, ratio in WORSE.items():
        counts = (own.mean(axis=1) > np.log(ratio)).sum(axis=1)
        table[name] = counts / own.shape[2]
        ends = [share_interval(int(count), own.shape[2]) for count in counts]
        table[f"{name}_low"], table[f"{name}_high"] = zip(*ends, strict=True)
    table["lost"] = lost_shares(rows, protocol.methods)
    return table.sort_values("own_ratio", kind="stable", ignore_index=True)


def what_it_is(method: AuditMethod) -> dict[str, str]:
    """Return what the adaptation of a method is, and its source."""
    known = provenance_of(plugins.get("adaptation", method.adaptation))
    return {"is": known.kind, "source": known.source} if known else {"is": "", "source": ""}


def _over_kinds(own: pd.DataFrame) -> dict[str, object]:
    faults, without = own[own["kind"] != NO_FAULT], own[own["kind"] == NO_FAULT]
    nothing = pd.Series(numbers_of(_NOTHING) | {"kind": ""})
    price = without.iloc[0] if len(without) else nothing
    worst = faults.iloc[int(faults["high"].argmax())] if len(faults) else nothing
    shown = faults["verdict"].value_counts()
    return {
        **{f"no_fault_{name}": price[name] for name in numbers_of(_NOTHING)},
        "better_kinds": int(shown.get(str(Verdict.BETTER), 0)),
        "worse_kinds": int(shown.get(str(Verdict.WORSE), 0)),
        "worst_kind": worst["kind"],
        "worst_ratio": worst["ratio"],
        "worst_high": worst["high"],
        "highest_ratio": own["ratio"].max(),
    }


def pays_from(d: FloatArray, without: BoolArray) -> FloatArray:
    """Return from which share of faulty drives on the log ratios d (M, D) are below 0; NaN: from none."""
    price, gain = d[:, without].mean(axis=1), d[:, ~without].mean(axis=1)
    dear = np.maximum(price, 0.0)  # a method that is better without a fault, too, pays from the share 0 on
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(gain < 0.0, dear / (dear - gain), np.nan))


# Estimators that stand apart.


def apart_frame(rows: AuditRows) -> pd.DataFrame:
    """Return an estimator a row: against the best plain filter and, adapted, against itself without adaptation."""
    protocol, methods = rows.protocol, rows.protocol.beside
    if not methods:
        return pd.DataFrame()
    own = cubes(rows, methods)
    R, D = own.tuned.shape[1:]
    plains = cubes(rows, protocol.plains)
    lowest = np.argmin(plains.on_tuning[:, :R], axis=0)
    best = plains.tuned[lowest, np.arange(R), :D]
    plain = {method.filter: place for place, method in enumerate(methods) if method.adaptation == protocol.plain}
    itself = own.tuned[[plain[method.filter] for method in methods]]
    level = LEVEL / (2 * len(methods) - len(plain))
    adapted = [place for place, method in enumerate(methods) if method.adaptation != protocol.plain]
    against = dict(zip(adapted, stated((own.tuned - itself)[adapted], level), strict=True)) if adapted else {}
    return pd.DataFrame(
        [
            {
                **method._asdict(),
                **numbers_of(said, "best_"),
                **numbers_of(against.get(place, _NOTHING), "own_"),
                "tunings": R,
                "drives": D,
            }
            for place, (method, said) in enumerate(zip(methods, stated(own.tuned - best, level), strict=True))
        ]
    ).assign(lost=lost_shares(rows, methods))


# What to take.


def take_frame(rows: AuditRows, losses: Losses) -> pd.DataFrame:
    """Return what to take in each situation: picked on every other drive, its ratio told of the other ones.

    So the luck of the pick is not in the number. The comparator is the best plain filter, tuned alike; plain filters of
    other models may be picked too.

    Returns:
        when, take, drives (of the ratio), ratio, low, high. The last situation is that the worst kind of fault shall be
        the least bad; its ratio is that of this worst kind.
    """
    methods = [*rows.protocol.methods, *rows.protocol.plains]
    tuned = np.concatenate([losses.methods, losses.plains])
    y, first = tuned - picked(losses)[0], np.arange(tuned.shape[2]) % 2 == 0
    halves = {kind: (own & first, own & ~first) for kind, own in kinds_of(rows).items()}
    halves = {kind: own for kind, own in halves.items() if min(own[0].sum(), own[1].sum()) >= FEWEST_DRIVES}

    def told(when: str, pick: int, other: BoolArray) -> dict[str, object]:
        said = stated(y[:, :, other], LEVEL)[pick]
        return {"when": when, "take": methods[pick].name, "drives": int(other.sum()), **numbers_of(said)}

    means = {kind: y[:, :, own].mean(axis=(1, 2)) for kind, (own, _) in halves.items()}
    lines = [told(NOTHING_KNOWN, int(y[:, :, first].mean(axis=(1, 2)).argmin()), ~first)]
    lines += [told(kind, int(means[kind].argmin()), other) for kind, (_, other) in halves.items()]
    if halves:
        least = int(np.max(list(means.values()), axis=0).argmin())
        worst = max((other for _, other in halves.values()), key=lambda other: float(y[least][:, other].mean()))
        lines.append(told(LEAST_BAD, least, worst))
    return pd.DataFrame(lines)


def leaders(rows: AuditRows, losses: Losses) -> list[str]:
    """Return which published method leads on the drives of each tuning."""
    names = np.array([method.name for method in rows.protocol.methods])[losses.picked]
    return [str(names[place]) for place in losses.tuned[losses.picked].argmin(axis=0)]


# Two audits.


def changed_verdicts(first: Statements, second: Statements, methods: Sequence[AuditMethod]) -> pd.DataFrame:
    """Return which verdicts of H3 two audits of the same ``methods`` do not share.

    Returns:
        filter, adaptation, against ("own" or "best"), first, second (verdicts).
    """
    pairs = {"own": (first.own_plain, second.own_plain), "best": (first.best_plain, second.best_plain)}
    lines = [
        {**method._asdict(), "against": against, "first": str(one.verdict), "second": str(other.verdict)}
        for against, (left, right) in pairs.items()
        for method, one, other in zip(methods, left, right, strict=True)
        if one.verdict is not other.verdict
    ]
    return pd.DataFrame(lines, columns=["filter", "adaptation", "against", "first", "second"])


# The answer in words: templates, each number of which comes from the rows.

EQUAL = f"equal within {100 * SMALL_MARGIN:.0f} %"


PAGE_TEMPLATES = Path(__file__).parent


def worded(template: Path, **values: object) -> str:
    """Return a filled template."""
    filters: dict[str, Callable[..., object]] = {
        "counts": counts_of,
        "verdicts": counts,
        "listed": listed,
        "interval": interval,
        "percent": percent,
    }
    filters |= {"spaced": lambda text: text.replace("_", " "), "two": "{:.2f}".format, "ratio": ratio_text}
    return filled_template(template, filters, **values)


def average_over_drives(losses: Losses) -> FloatArray:
    """Return the log ratio (D,) of the average adaptation on each drive, mean over the tunings."""
    return np.asarray(comparisons(losses)[0][0].mean(axis=0))


def main_kind(rows: AuditRows, losses: Losses) -> str:
    """Return the kind of fault that the average adaptation gains most from: without it, least is left of the gain."""
    average = average_over_drives(losses)
    known = {kind: own for kind, own in kinds_of(rows).items() if kind != NO_FAULT and own.sum() >= FEWEST_DRIVES}
    return max(known, key=lambda kind: float(average[~known[kind]].mean()))


def counts(said: Sequence[Statement]) -> dict[str, int]:
    """Return how many statements have each verdict."""
    return counts_of(one.verdict for one in said)


def counts_of(verdicts: Iterable[object]) -> dict[str, int]:
    """Return how many are better, worse, equal and undecided."""
    known = Counter(map(str, verdicts))
    return {str(word): known[word] for word in (Verdict.BETTER, Verdict.WORSE, Verdict.EQUAL, Verdict.UNDECIDED)}


def listed(known: Mapping[str, int]) -> str:
    """Say how many have each verdict."""
    return ", ".join(f"{count} {word}" for word, count in known.items())


def ratio_text(numbers: Mapping[str, Any], prefix: str = "") -> str:
    """Say a ratio with its interval and its verdict, from the columns of `numbers_of`; nothing where there is none."""
    ratio, low, high, verdict, small = (numbers[prefix + name] for name in ("ratio", "low", "high", "verdict", "small"))
    return f"{ratio:.2f} [{low:.2f}, {high:.2f}] {_word(verdict, small=small)}" if np.isfinite(ratio) else ""


def interval(said: Statement) -> str:
    """Say a ratio with its interval, and its verdict in parentheses."""
    return f"{said.ratio:.2f} [{said.low:.2f}, {said.high:.2f}] ({_word(said.verdict, small=said.small)})"


def _word(verdict: str, *, small: bool) -> str:
    if verdict == Verdict.EQUAL:
        return EQUAL
    return f"{verdict}, by less than 10 %" if small and verdict != Verdict.UNDECIDED else str(verdict)


def percent(share: float) -> str:
    """Say a share."""
    return f"{100 * share:.0f} %"


def compared_text(rows: Sequence[AuditRows], losses: Sequence[Losses]) -> str:
    """Say how many verdicts two audits of the same methods do not share; one that turns round is a defect.

    Args:
        rows: those of both audits.
        losses: theirs, `losses_of`.
    """
    methods, kind = rows[0].protocol.methods, main_kind(rows[0], losses[0])
    said = [statements(each) for each in losses]
    changed = changed_verdicts(said[0], said[1], methods)
    turned = changed[changed[["first", "second"]].isin([str(Verdict.BETTER), str(Verdict.WORSE)]).all(axis=1)]
    return worded(
        PAGE_TEMPLATES / "second.md.jinja",
        changed=changed,
        statements=2 * len(methods),
        turned=turned.to_dict("records"),
        said=said,
        kind=kind,
        without=[reweighted(*each, f"{kind}=0").average for each in zip(rows, losses, strict=True)],
    )


SECOND = "second.md"
"""How an audit with other drives and tunings differs, where the two were compared."""


def answer_summary(answer: AuditAnswer, commit: str) -> dict[str, object]:
    """Return the answer for programs, to twelve decimals: what follows differs from processor to processor."""
    protocol, said = answer.rows.protocol, answer.said
    summary = {
        "protocol": protocol.digest,
        "commit": commit,
        "drives": protocol.judged_drives,
        "faulty": float(1.0 - kinds_of(answer.rows)[NO_FAULT].mean()),
        "tunings": protocol.tunings,
        "methods": len(answer.methods),
        "adaptations": len(protocol.compared),
        "filters": list(protocol.filters),
        "sentences": answer.sentences,
        "against_own_plain": counts(said.own_plain),
        "against_best_plain": counts(said.best_plain),
        "average": asdict(said.average) | {"verdict": str(said.average.verdict)},
        "pick": asdict(said.pick) | {"verdict": str(said.pick.verdict)},
        "error": answer.error._asdict(),
        "take": json.loads(answer.take.to_json(orient="records")),
    }
    return dict(json.loads(pd.Series(summary).to_json(double_precision=12)))


# The folder of an audit: its protocol before anything runs, then its rows, then what they say.

AUDIT_FOLDER = "audit-"
"""The name of a folder begins with it; the scale follows."""


def judged_audit(folder: Path) -> AuditAnswer:
    """Judge the rows in ``folder``, whatever version computed them, and write answer.json and the tables.

    Raises:
        JerkbenchError: there are none.
    """
    answer = answered(read_rows(folder))
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    summary = answer_summary(answer, read_audit_manifest(folder)["git_commit"])
    write_text(folder / "answer.json", json.dumps(summary, indent=1) + "\n")
    return answer


def compare_audits(folder: Path, other: Path) -> str:
    """Compare two audits of the same methods, and write what they do not share into the folder of the first.

    Raises:
        JerkbenchError: one is not there, or they are of other methods.
    """
    rows = [read_rows(each) for each in (folder, other)]
    if rows[0].protocol.methods != rows[1].protocol.methods:
        raise JerkbenchError(f"{folder} and {other} compare other methods; give two audits of the same.")
    text = compared_text(rows, [losses_of(each) for each in rows])
    write_text(folder / SECOND, text)
    return text
