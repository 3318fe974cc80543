"""The page of an audit, its pictures and its numbers for programs; every sentence with a number comes from the rows."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from jerkbench import plugins
from jerkbench.audit.answer import (
    NO_FAULT,
    AuditAnswer,
    answered,
    average_over_drives,
    by_trace,
    compared_text,
    counts,
    counts_of,
    kinds_of,
    told_truth,
    worded,
)
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.runs import collected, losses_of, read_manifest, read_rows, write_manifest, write_protocol
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.intervals import share_interval
from jerkbench.evaluation.judgement import Verdict
from jerkbench.files import write_text
from jerkbench.jobs.executors import Cluster, Workers
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.notices import notify
from jerkbench.parameters import provenance_of
from jerkbench.report.plots.style import DOTS_PER_INCH, OKABE_ITO, save_figure
from jerkbench.tuning.entrant import Site

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_FARTHEST = 5.0
"""The colour goes no further than five times better or worse."""
DARK = 2.5
"""From this ratio on, or its inverse, the field is so dark that its number is white."""
TICKS = (0.25, 0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0, 4.0)
_ROW_IN, COLUMN_IN = 0.18, 0.3
"""So narrow that a number can be read where the page is 600 pixels wide."""


def kinds_figure(kinds: pd.DataFrame, overall: pd.DataFrame, margin: float) -> Figure:
    """Draw ratios to the plain filter, tuned alike: blue is better, red is worse, bold is shown.

    Args:
        kinds: name, kind, ratio, verdict.
        overall: name, own_ratio, own_low, own_high, best_ratio, best_low, best_high; a row each, in this order.
        margin: what lies within 1 + margin is equal.
    """
    names, columns = list(overall["name"]), list(dict.fromkeys(kinds["kind"]))
    size = (3.0 + COLUMN_IN * max(len(columns), 4), 1.8 + _ROW_IN * max(len(names), 6))
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[COLUMN_IN * max(len(columns), 4), 1.7], sharey=True)
    _draw_kinds(figure, left, kinds, names, columns)
    _draw_overall(right, overall, margin)
    return figure


def _draw_kinds(figure: Figure, axes: "Axes", kinds: pd.DataFrame, names: list[str], columns: list[str]) -> None:
    table = kinds.pivot_table(index="name", columns="kind", values="ratio").reindex(index=names, columns=columns)
    shown = set(kinds.loc[kinds["verdict"] != Verdict.UNDECIDED, ["name", "kind"]].itertuples(index=False, name=None))
    scale = LogNorm(1 / _FARTHEST, _FARTHEST, clip=True)
    image = axes.imshow(table.to_numpy(dtype=float), cmap="RdBu_r", norm=scale, aspect="auto")
    for row, name in enumerate(names):
        for column, kind in enumerate(columns):
            ratio, bold = float(table.loc[name, kind]), (name, kind) in shown  # type: ignore[arg-type]
            ink = "black" if bold else "0.35"
            style: dict[str, Any] = {
                "weight": "bold" if bold else "normal",
                "color": ink if 1 / DARK < ratio < DARK else "white",
            }
            axes.text(column, row, f"{ratio:.2f}", ha="center", va="center", fontsize=6.5, **style)
    heads = [kind.replace("_", " ") for kind in columns]
    axes.set_xticks(range(len(columns)), heads, rotation=60, ha="left", rotation_mode="anchor", fontsize=7)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    ticks = [0.2, 0.5, 1, 2, 5]
    bar = figure.colorbar(image, ax=axes, ticks=ticks, format="%g", location="bottom", shrink=0.8, aspect=50, pad=0.02)
    bar.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label("error / that of the plain filter of its model, tuned alike; bold: shown", fontsize=7)


def _draw_overall(axes: "Axes", overall: pd.DataFrame, margin: float) -> None:
    rows = np.arange(len(overall))
    axes.axvspan(1 / (1 + margin), 1 + margin, color="0.9", linewidth=0)
    axes.axvline(1.0, color="0.6", linewidth=0.8)
    for against, colour, shift in (("own", OKABE_ITO[0], -0.17), ("best", OKABE_ITO[1], 0.17)):
        label = {"own": "plain filter of its model", "best": "best plain filter"}[against]
        ends = overall[f"{against}_low"], overall[f"{against}_high"]
        axes.hlines(rows + shift, *ends, color=colour, linewidth=1.2)
        axes.plot(overall[f"{against}_ratio"], rows + shift, "o", color=colour, markersize=3, label=label)
    axes.set_xscale("log")
    low, high = _limits(overall)
    axes.set_xlim(low, high)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks([tick for tick in TICKS if low < tick < high])
    axes.tick_params(axis="x", labelsize=7)
    axes.tick_params(axis="y", length=0, labelleft=False)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_xlabel("over all drives", fontsize=7)
    axes.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        fontsize=7,
        frameon=False,
        title="relative to the",
        title_fontsize=7,
    )


def _limits(overall: pd.DataFrame) -> tuple[float, float]:
    """The span of all intervals, as far as the ratios themselves and five times about 1."""
    low, high = overall[["own_low", "best_low"]].min().min(), overall[["own_high", "best_high"]].max().max()
    return max(float(low), 1 / _FARTHEST) / 1.05, min(float(high), _FARTHEST) * 1.05


ELSEWHERE = ("journeys", "vehicles", "attitude")
"""Studies beside the audit, of real recordings; what each found stands in its folder, in `FOUND`."""
FOUND = "answer.md"
SECOND = "second.md"
"""What an audit with other drives and tunings had in common, where it was compared."""
SHOWN = 15
"""Methods in the table of worst cases."""


def write_page(answer: AuditAnswer, folder: Path, commit: str) -> None:
    """Write README.md, its pictures, methods.csv, kinds.csv, apart.csv and answer.json into ``folder``."""
    margin = answer.rows.protocol.margin
    kinds, methods = (of.assign(name=of["filter"] + " + " + of["adaptation"]) for of in (answer.kinds, answer.methods))
    save_figure(kinds_figure(kinds, methods, margin), folder / "kinds.png")
    kinds, means = (t.assign(name=t["adaptation"]) for t in (answer.adaptations_by_kind, answer.adaptations))
    save_figure(kinds_figure(kinds, means, margin), folder / "answer.png")
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    write_text(folder / "answer.json", json.dumps(answer_summary(answer, commit), indent=1) + "\n")
    write_text(folder / "README.md", audit_page(answer, folder, commit))


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


def audit_page(answer: AuditAnswer, folder: Path, commit: str) -> str:
    """Return the page as Markdown; what was found elsewhere is read beside ``folder``."""
    rows, methods, average = answer.rows, answer.methods, average_over_drives(answer.losses)
    protocol, status = rows.protocol, rows.judged["status"].astype(str)
    levels = rows.judged["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    return worded(
        "page",
        answer=answer,
        p=protocol,
        scale=folder.name.rpartition("-")[2],
        commit=commit or "unknown",
        methods=methods,
        n=len(methods),
        error=answer.error,
        errs=share_interval(answer.error.wrong, answer.error.audits),
        dear=np.exp(rows.judged["log_error"] - levels) > protocol.lost_costs,
        runs=len(status),
        usual=float(np.exp(np.median(average))),
        often=float((average < 0).mean()),
        traces=by_trace(rows, average),
        failed=status.str.startswith("failed").sum(),
        by_kind=_by_kind(answer.kinds),
        least=methods.dropna(subset=["worst_high"]).sort_values("worst_high", kind="stable").head(SHOWN),
        shown=SHOWN,
        truth=told_truth(answer),
        elsewhere=_texts(folder.parent / name / FOUND for name in ELSEWHERE),
        second=_texts([folder / SECOND]),
        sources=[(name, of) for name in protocol.compared if (of := provenance_of(plugins.get("adaptation", name)))],
    )


def _by_kind(kinds: pd.DataFrame) -> list[dict[str, Any]]:
    """For each kind of fault: drives, methods better and worse, the lowest and the highest ratio."""
    lines: list[dict[str, Any]] = []
    for kind, own in kinds.groupby("kind"):
        low, high = own.sort_values("ratio").iloc[[0, -1]].to_dict("records")
        lines.append({"kind": kind, "drives": low["drives"], "low": low, "high": high, **counts_of(own["verdict"])})
    return sorted(lines, key=lambda line: (line["kind"] != NO_FAULT, -line["better"], line["worse"]))


def _texts(paths: Iterable[Path]) -> str:
    return "\n\n".join(path.read_text(encoding="utf-8").strip() for path in paths if path.exists())


# The folder of an audit: its protocol before anything runs, then its rows, then what they say.

AUDIT_FOLDER = "audit-"
"""The name of a folder begins with it; the scale follows."""
CHANGED = "+changes"
"""The end of a commit with changes."""


def run_audit(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> AuditAnswer:
    """Run what is not stored in ``folder`` yet, and write the rows and the page.

    Args:
        protocol: what is compared.
        folder: of the audit.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.

    Raises:
        JerkbenchError: the folder has another protocol's results, or a run cannot be made.
        OSError: nothing can be written.
    """
    made = {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
    if git_commit().endswith(CHANGED):
        notify("the tree has changes that are not committed: nobody else can have this code, and the page says so")
    write_protocol(protocol, folder)
    with Workers(cluster, workers) as own:
        collected(protocol, Site(folder / "runs", own)).write(folder)
    write_manifest(folder, made)
    return judged_audit(folder)


def judged_audit(folder: Path) -> AuditAnswer:
    """Judge the rows in ``folder``, whatever version computed them, and write the page.

    Raises:
        JerkbenchError: there are none.
    """
    answer = answered(read_rows(folder))
    write_page(answer, folder, read_manifest(folder)["git_commit"])
    return answer


def compare_audits(folder: Path, other: Path) -> str:
    """Compare two audits of the same methods, and put what they do not share on the page of the first.

    Raises:
        JerkbenchError: one is not there, or they are of other methods.
    """
    rows = [read_rows(each) for each in (folder, other)]
    if rows[0].protocol.methods != rows[1].protocol.methods:
        raise JerkbenchError(f"{folder} and {other} compare other methods; give two audits of the same.")
    text = compared_text(rows, [losses_of(each) for each in rows])
    write_text(folder / SECOND, text)
    return text
