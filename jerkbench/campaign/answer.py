"""The answer of an audit: what its rows show about each method, under each kind of fault, and about all methods."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaign.audit import (
    METHOD_COLUMNS,
    AuditRows,
    cubes,
    defaults,
    failure_rates,
    losses_of,
    read_audit_manifest,
    read_rows,
)
from jerkbench.campaign.protocol import PUBLISHED, AuditMethod
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.drives_and_tunings import (
    Error,
    Losses,
    Statement,
    Statements,
    comparisons,
    procedure_error,
    stated,
    statements,
)
from jerkbench.evaluation.intervals import share_interval
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import write_text
from jerkbench.parameters import provenance_of

AUDIT_FOLDER = "audit-"
"""Start of the name of the folder of an audit; the scale follows."""
SECOND = "second.md"
"""The comparison with an audit of other drives and tunings."""
FAULT = "drawn.fault."
"""Start of the columns of drives with a kind of fault."""
NO_FAULT = "no fault"
MIN_DRIVES = 5
"""Drives of a kind of fault with which its ratio is stated."""
WORSE = {"worse_3": 1.03, "worse_100": 2.0}
"""Ratios above which a single drive counts as worse, by the name of the column."""


@dataclass(frozen=True)
class AuditAnswer:
    """The answer of an audit.

    Attributes:
        rows: rows of the audit.
        losses: log errors by method, tuning and drive.
        said: statements of the three families of hypotheses.
        methods: one row for each method, the lowest ratio to the plain filter of its model first.
        kinds: one row for each method and kind of fault.
        apart: one row for each estimator that is shown in a table of its own.
        error: error rate of the complete procedure.
    """

    rows: AuditRows
    losses: Losses
    said: Statements
    methods: pd.DataFrame
    kinds: pd.DataFrame
    apart: pd.DataFrame
    error: Error

    @property
    def sentences(self) -> list[str]:
        """The answer in sentences."""
        taken = self.methods[self.methods["is"].isin(PUBLISHED)]
        own, best = counts_of(taken["own_verdict"]), counts_of(taken["best_verdict"])
        average = "The error of the average adaptation, relative to the plain filter of its model"
        pick = (
            "The error of the adaptive filter that is best in tuning, relative to the plain filter that is best there"
        )
        counts = (
            f"{own['better']} are better than the equally tuned plain filter of their model, {own['worse']} are worse"
        )
        return [
            f"Of {len(taken)} published or simplified adaptive filters, {counts}.",
            f"Compared with the best plain filter, {best['better']} are better and {best['worse']} are worse.",
            f"{average}: {self.said.average}.",
            f"{pick}: {self.said.pick}.",
        ]


def answered(rows: AuditRows) -> AuditAnswer:
    """Return the answer that follows from the rows of an audit."""
    losses = losses_of(rows)
    said = statements(losses)
    kinds = kind_frame(comparisons(losses)[2], [method._asdict() for method in rows.protocol.methods], rows)
    methods = method_frame(rows, losses, said, kinds)
    error = procedure_error(losses, rows.protocol.resampled_audits)
    return AuditAnswer(rows, losses, said, methods, kinds, apart_frame(rows), error)


def kinds_of(rows: AuditRows) -> dict[str, BoolArray]:
    """Return which of the judged drives (D,) have no fault, and which have each kind; a drive may have several."""
    judged = rows.drives.set_index("seed").loc[list(rows.protocol.seeds_to_judge_on)]
    columns = judged.reindex(columns=[FAULT + str(kind) for kind, *_ in rows.protocol.laws["faults"]]).notna()
    drives = {str(name).removeprefix(FAULT): own.to_numpy() for name, own in columns.items()}
    return {NO_FAULT: ~columns.any(axis=1).to_numpy(), **drives}


def kind_frame(y: FloatArray, names: Sequence[Mapping[str, str]], rows: AuditRows) -> pd.DataFrame:
    """Return the ratio of each of y (k, R, D) under each kind of fault. The intervals hold for all of them together.

    A kind of fault with too few drives is left out.
    """
    known = {kind: drives for kind, drives in kinds_of(rows).items() if drives.sum() >= MIN_DRIVES}
    level = LEVEL / (len(y) * len(known)) if known else LEVEL
    lines = [
        {**name, "kind": kind, "drives": int(drives.sum()), **numbers_of(said)}
        for kind, drives in known.items()
        for name, said in zip(names, stated(y[:, :, drives], level), strict=True)
    ]
    return pd.DataFrame(lines, columns=[*names[0], "kind", "drives", *numbers_of(_NOTHING)])


def numbers_of(said: Statement, prefix: str = "") -> dict[str, object]:
    """Return a statement as columns."""
    names = ("ratio", "low", "high", "verdict", "small")
    return {prefix + name: str(said.verdict) if name == "verdict" else getattr(said, name) for name in names}


_NOTHING = Statement(np.nan, np.nan, np.nan, Verdict.UNDECIDED, small=False, tuning_sd=np.nan)
"""The statement without data."""


def method_frame(rows: AuditRows, losses: Losses, said: Statements, kinds: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each method.

    Returns:
        filter, adaptation; is, source (provenance); own_*, best_* (against the plain filter of its model and the best
        one); untuned; no_fault_* ; better_kinds, worse_kinds; worst_kind, worst_ratio, worst_high; pays_from (fraction
        of faulty drives); worse_3, worse_100 with _low and _high (fraction of drives on which it is worse by 3 % and by
        100 %); lost (fraction of failed runs).
    """
    methods, own = rows.protocol.methods, comparisons(losses)[2]
    plain = losses.plains[losses.model].mean(axis=1)
    lines = []
    for method, mine, best in zip(methods, said.own_plain, said.best_plain, strict=True):
        known = provenance_of(plugins.get("adaptation", method.adaptation))
        origin = {"is": known.kind, "source": known.source} if known else {"is": "", "source": ""}
        lines.append({**method._asdict(), **origin, **numbers_of(mine, "own_"), **numbers_of(best, "best_")})
    table = pd.DataFrame(lines)
    table["untuned"] = np.exp((defaults(rows, methods) - plain).mean(axis=1))
    table["tuning_sd"] = [one.tuning_sd for one in said.own_plain]
    of_method = [kinds[(kinds[METHOD_COLUMNS] == list(method)).all(axis=1)] for method in methods]
    table = table.join(pd.DataFrame([_over_kinds(each) for each in of_method]))
    table["pays_from"] = pays_from(own.mean(axis=1), kinds_of(rows)[NO_FAULT])
    for name, ratio in WORSE.items():
        counts = (own.mean(axis=1) > np.log(ratio)).sum(axis=1)
        table[name] = counts / own.shape[2]
        ends = [share_interval(int(count), own.shape[2]) for count in counts]
        table[f"{name}_low"], table[f"{name}_high"] = zip(*ends, strict=True)
    table["lost"] = failure_rates(rows, methods)
    return table.sort_values("own_ratio", kind="stable", ignore_index=True)


def _over_kinds(own: pd.DataFrame) -> dict[str, object]:
    """The columns of a method that summarise its ratios under the kinds of faults."""
    faults, without = own[own["kind"] != NO_FAULT], own[own["kind"] == NO_FAULT]
    nothing = pd.Series(numbers_of(_NOTHING) | {"kind": ""})
    price = without.iloc[0] if len(without) else nothing
    worst = faults.iloc[int(faults["high"].argmax())] if len(faults) else nothing
    counts = counts_of(faults["verdict"])
    return {
        **{f"no_fault_{name}": price[name] for name in numbers_of(_NOTHING)},
        "better_kinds": counts["better"],
        "worse_kinds": counts["worse"],
        "worst_kind": worst["kind"],
        "worst_ratio": worst["ratio"],
        "worst_high": worst["high"],
        "highest_ratio": own["ratio"].max(),
    }


def pays_from(d: FloatArray, without: BoolArray) -> FloatArray:
    """Return the fraction of faulty drives above which the mean of the log ratios d (M, D) is negative; NaN: none."""
    price, gain = np.maximum(d[:, without].mean(axis=1), 0.0), d[:, ~without].mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(gain < 0.0, price / (price - gain), np.nan))


def apart_frame(rows: AuditRows) -> pd.DataFrame:
    """Return one row for each estimator apart: against the best plain filter, and against itself without adaptation."""
    protocol, methods = rows.protocol, rows.protocol.beside
    if not methods:
        return pd.DataFrame()
    tuned = cubes(rows, methods).tuned
    tunings, drives = tuned.shape[1:]
    plains = cubes(rows, protocol.plains)
    lowest = np.argmin(plains.on_tuning[:, :tunings], axis=0)
    best = plains.tuned[lowest, np.arange(tunings), :drives]
    plain = {method.filter: k for k, method in enumerate(methods) if method.adaptation == protocol.plain}
    adapted = [k for k, method in enumerate(methods) if method.adaptation != protocol.plain]
    itself = tuned[[plain[methods[k].filter] for k in adapted]]
    level = LEVEL / (2 * len(methods) - len(plain))
    against = dict(zip(adapted, stated(tuned[adapted] - itself, level) if adapted else (), strict=True))
    lines = [
        {
            **method._asdict(),
            **numbers_of(said, "best_"),
            **numbers_of(against.get(k, _NOTHING), "own_"),
            "tunings": tunings,
            "drives": drives,
        }
        for k, (method, said) in enumerate(zip(methods, stated(tuned - best, level), strict=True))
    ]
    return pd.DataFrame(lines).assign(lost=failure_rates(rows, methods))


def counts_of(verdicts: Iterable[object]) -> dict[str, int]:
    """Return how many verdicts are better, worse, equal and undecided."""
    known = Counter(map(str, verdicts))
    return {str(word): known[word] for word in (Verdict.BETTER, Verdict.WORSE, Verdict.EQUAL, Verdict.UNDECIDED)}


def judged_audit(folder: Path) -> AuditAnswer:
    """Return the answer of the rows in ``folder``, whatever version computed them; write answer.json and the tables.

    Raises:
        JerkbenchError: There are no rows.
    """
    answer = answered(read_rows(folder))
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    summary = answer_summary(answer, read_audit_manifest(folder)["git_commit"])
    write_text(folder / "answer.json", json.dumps(summary, indent=1) + "\n")
    return answer


def answer_summary(answer: AuditAnswer, commit: str) -> dict[str, object]:
    """Return the answer for programs, to twelve decimals, because more digits differ between processors."""
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
        "against_own_plain": counts_of(one.verdict for one in said.own_plain),
        "against_best_plain": counts_of(one.verdict for one in said.best_plain),
        "average": asdict(said.average) | {"verdict": str(said.average.verdict)},
        "pick": asdict(said.pick) | {"verdict": str(said.pick.verdict)},
        "error": answer.error._asdict(),
    }
    return dict(json.loads(pd.Series(summary).to_json(double_precision=12)))


def compare_audits(folder: Path, other: Path) -> str:
    """Compare two audits of the same methods, and write the differences to the folder of the first one.

    Raises:
        JerkbenchError: An audit is missing, or they have other methods.
    """
    rows = [read_rows(each) for each in (folder, other)]
    if rows[0].protocol.methods != rows[1].protocol.methods:
        raise JerkbenchError(f"{folder} and {other} compare other methods; give two audits of the same.")
    text = compared_text(rows[0].protocol.methods, *(statements(losses_of(each)) for each in rows))
    write_text(folder / SECOND, text)
    return text


def compared_text(methods: Sequence[AuditMethod], first: Statements, second: Statements) -> str:
    """Return how many verdicts of H3 differ between two audits of the same ``methods``, and which are reversed."""
    families = ("own", first.own_plain, second.own_plain), ("best", first.best_plain, second.best_plain)
    changed = [
        (method.name, against, one.verdict, other.verdict)
        for against, *pair in families
        for method, one, other in zip(methods, *pair, strict=True)
        if one.verdict is not other.verdict
    ]
    turned = [own for own in changed if {*own[2:]} == {Verdict.BETTER, Verdict.WORSE}]
    defect = ", which is a defect" if turned else ""
    head = (
        f"An audit with other drives and other tunings changes {len(changed)} of {2 * len(methods)} verdicts;"
        f" {len(turned)} turn from better to worse or back{defect}. The error of the average adaptation relative to the"
        f" plain filter is {first.average}, then {second.average}. The error of the method that is best in tuning is"
        f" {first.pick}, then {second.pick}."
    )
    lines = [f"- {name}, {against} plain filter: {one}, then {other}" for name, against, one, other in turned]
    return "\n".join([head, *lines])
