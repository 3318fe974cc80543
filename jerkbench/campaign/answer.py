"""The results of an audit: statements about each method, about each kind of fault, and about all methods together."""

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
from jerkbench.campaign.protocol import PUBLISHED
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
"""Prefix of the name of the folder of an audit. The name of the protocol follows the prefix."""
FAULT = "drawn.fault."
"""Prefix of the columns for kinds of fault in the table of drives. A value is missing if the drive lacks the fault."""
NO_FAULT = "no fault"
MIN_DRIVES = 5
"""Minimum number of drives with a kind of fault for which a ratio is computed."""
WORSE = {"worse_3": 1.03, "worse_100": 2.0}
"""Ratios to the error of the plain filter above which a method counts as worse on a drive, by column name."""


@dataclass(frozen=True)
class AuditAnswer:
    """The results of an audit, computed from its runs.

    Attributes:
        rows: The tables of the runs, from which all other attributes are computed.
        losses: The log position errors of each method, in each tuning, on each evaluation drive.
        said: The statistical statements about H1 to H3, the three families of hypotheses of the audit.
        methods: Table of the methods, sorted by the ratio of their error to the error of the same filter without
            adaptation.
        kinds: Table with one row for each combination of a method and a kind of fault.
        apart: Table with one row for each estimator that the audit evaluates separately from the other methods.
        error: The error rate of the complete statistical procedure, estimated by resampling.
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
        """The main findings of the audit as English sentences."""
        taken = self.methods[self.methods["is"].isin(PUBLISHED)]
        same_model, best = counts_of(taken["own_verdict"]), counts_of(taken["best_verdict"])
        average = "The error of the average adaptation, relative to the plain filter of its model"
        pick = "The error of the adaptive filter that is best in tuning, relative to the best plain filter there"
        counts = f"{same_model['better']} are better than the equally tuned plain filter of their model"
        return [
            f"Of {len(taken)} published or simplified adaptive filters, {counts}, {same_model['worse']} are worse.",
            f"Compared with the best plain filter, {best['better']} are better and {best['worse']} are worse.",
            f"{average}: {self.said.average}.",
            f"{pick}: {self.said.pick}.",
        ]


def answered(rows: AuditRows) -> AuditAnswer:
    """Compute the results of an audit from the tables of its runs."""
    losses = losses_of(rows)
    said = statements(losses)
    kinds = kind_frame(comparisons(losses)[2], [method._asdict() for method in rows.protocol.methods], rows)
    methods = method_frame(rows, losses, said, kinds)
    error = procedure_error(losses, rows.protocol.resampled_audits)
    return AuditAnswer(rows, losses, said, methods, kinds, separate_frame(rows), error)


def kinds_of(rows: AuditRows) -> dict[str, BoolArray]:
    """Return masks (D,) of the drives with each kind of fault and of the drives without a fault, by name."""
    judged = rows.drives.set_index("seed").loc[list(rows.protocol.seeds_to_judge_on)]
    columns = judged.reindex(columns=[FAULT + str(kind) for kind, *_ in rows.protocol.laws["faults"]]).notna()
    drives = {str(name).removeprefix(FAULT): column.to_numpy() for name, column in columns.items()}
    return {NO_FAULT: ~columns.any(axis=1).to_numpy(), **drives}


def kind_frame(y: FloatArray, names: Sequence[Mapping[str, str]], rows: AuditRows) -> pd.DataFrame:
    """Return a table with the error ratio of each method for each kind of fault.

    The confidence intervals of the error ratios hold simultaneously for all rows of the table. Kinds of fault that
    occur on fewer than `MIN_DRIVES` drives are left out.

    Args:
        y: (k, R, D) log ratios of the errors of k methods to the errors of a plain filter, in R tunings, on D drives.
        names: For each of the k methods, the columns that identify the method.
        rows: The tables of the audit.
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
    """Return the numbers and the verdict of a statement by column name. Each column name starts with ``prefix``."""
    names = ("ratio", "low", "high", "verdict", "small")
    return {prefix + name: str(said.verdict) if name == "verdict" else getattr(said, name) for name in names}


_NOTHING = Statement(np.nan, np.nan, np.nan, Verdict.UNDECIDED, small=False, tuning_sd=np.nan)
"""A statement without data: NaN and undecided."""


def method_frame(rows: AuditRows, losses: Losses, said: Statements, kinds: pd.DataFrame) -> pd.DataFrame:
    """Return a table with the provenance, the error ratios and the failure rate of each method.

    Returns:
        A table with one row for each method. The columns ``is`` and ``source`` contain the provenance of the
        adaptation. Columns that start with ``own_`` compare the method with the tuned plain filter of the same model.
        Columns that start with ``best_`` compare the method with the best plain filter. Columns that start with
        ``no_fault_`` contain the comparison on drives without a fault. The column ``untuned`` contains the error ratio
        with the default setting. The column ``tuning_sd`` contains the standard deviation, across tunings, of the log
        error ratio. The columns ``better_kinds`` and ``worse_kinds`` count the kinds of fault for which the method
        is better or worse. Columns that start with ``worst_`` describe the kind of fault with the largest upper limit
        of the error ratio. The column ``pays_from`` contains the fraction of faulty drives above which the method
        reduces the mean log error. The columns ``worse_3`` and ``worse_100`` contain the fractions of drives on which
        the error is more than 3 % or 100 % larger. The column ``lost`` contains the fraction of failed runs.
    """
    methods, log_ratios = rows.protocol.methods, comparisons(losses)[2]
    plain = losses.plains[losses.model].mean(axis=1)
    lines = []
    for method, same_model, best in zip(methods, said.same_model_plain, said.best_plain, strict=True):
        known = provenance_of(plugins.get("adaptation", method.adaptation))
        origin = {"is": known.kind, "source": known.source} if known else {"is": "", "source": ""}
        lines.append({**method._asdict(), **origin, **numbers_of(same_model, "own_"), **numbers_of(best, "best_")})
    table = pd.DataFrame(lines)
    table["untuned"] = np.exp((defaults(rows, methods) - plain).mean(axis=1))
    table["tuning_sd"] = [one.tuning_sd for one in said.same_model_plain]
    of_method = [kinds[(kinds[METHOD_COLUMNS] == list(method)).all(axis=1)] for method in methods]
    table = table.join(pd.DataFrame([_over_kinds(each) for each in of_method]))
    table["pays_from"] = pays_from(log_ratios.mean(axis=1), kinds_of(rows)[NO_FAULT])
    for name, ratio in WORSE.items():
        counts = (log_ratios.mean(axis=1) > np.log(ratio)).sum(axis=1)
        table[name] = counts / log_ratios.shape[2]
        ends = [share_interval(int(count), log_ratios.shape[2]) for count in counts]
        table[f"{name}_low"], table[f"{name}_high"] = zip(*ends, strict=True)
    table["lost"] = failure_rates(rows, methods)
    return table.sort_values("own_ratio", kind="stable", ignore_index=True)


def _over_kinds(ratios: pd.DataFrame) -> dict[str, object]:
    faults, without = ratios[ratios["kind"] != NO_FAULT], ratios[ratios["kind"] == NO_FAULT]
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
        "highest_ratio": ratios["ratio"].max(),
    }


def pays_from(d: FloatArray, without: BoolArray) -> FloatArray:
    """Return the fraction of faulty drives above which the mean log error ratio of a method is negative, shape (M,).

    The fraction is NaN if the mean log error ratio on faulty drives is not negative. ``d`` (M, D) contains the log
    ratios of the errors of M methods to the errors of the plain filters. ``without`` (D,) marks the drives without a
    fault.
    """
    price, gain = np.maximum(d[:, without].mean(axis=1), 0.0), d[:, ~without].mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(gain < 0.0, price / (price - gain), np.nan))


def separate_frame(rows: AuditRows) -> pd.DataFrame:
    """Return a table with one row for each estimator that the audit evaluates separately from the other methods.

    Each estimator is compared with the best plain filter. An estimator with an adaptation is also compared with the
    same estimator without adaptation.
    """
    protocol, methods = rows.protocol, rows.protocol.separate
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
    """Return the number of verdicts of each kind: better, worse, equal and undecided."""
    known = Counter(map(str, verdicts))
    return {
        str(verdict): known[verdict] for verdict in (Verdict.BETTER, Verdict.WORSE, Verdict.EQUAL, Verdict.UNDECIDED)
    }


def judged_audit(folder: Path) -> AuditAnswer:
    """Compute the results of an audit from the runs in ``folder``, and write them to answer.json and to CSV tables.

    Raises:
        JerkbenchError: The folder contains no audit, or the audit was changed.
    """
    answer = answered(read_rows(folder))
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    summary = answer_summary(answer, read_audit_manifest(folder)["git_commit"])
    write_text(folder / "answer.json", json.dumps(summary, indent=1) + "\n")
    return answer


def answer_summary(answer: AuditAnswer, commit: str) -> dict[str, object]:
    """Return the results of an audit as plain data, rounded to twelve decimals to be equal on all processors."""
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
        "against_own_plain": counts_of(one.verdict for one in said.same_model_plain),
        "against_best_plain": counts_of(one.verdict for one in said.best_plain),
        "average": asdict(said.average) | {"verdict": str(said.average.verdict)},
        "pick": asdict(said.pick) | {"verdict": str(said.pick.verdict)},
        "error": answer.error._asdict(),
    }
    return dict(json.loads(pd.Series(summary).to_json(double_precision=12)))
