"""The page and the pictures of an audit, from its stored rows.

python experiments/audit/audit_page.py results/audit-full                          writes README.md, answer.png and
                                                                                   kinds.png into this folder
python experiments/audit/audit_page.py results/audit-full --reweight faulty=0.05   prints the answer for another
                                                                                   share of drives with a fault
"""

import argparse
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.audit.answer import (
    NO_FAULT,
    AuditAnswer,
    answered,
    average_over_drives,
    counts_of,
    kind_frame,
    numbers_of,
    reweighted,
    worded,
)
from jerkbench.audit.protocol import AuditMethod
from jerkbench.audit.runs import AuditRows, cubes, losses_of, read_audit_manifest, read_rows
from jerkbench.evaluation.drives_and_tunings import Losses, comparisons, picked, stated, statements
from jerkbench.evaluation.intervals import share_interval
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import write_text
from jerkbench.parameters import provenance_of
from jerkbench.report.plots.style import DOTS_PER_INCH, OKABE_ITO, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HERE = Path(__file__).parent
TRACE = "drawn.replayed_gnss.trace."
"""Columns of drives that name the replayed receiver begin so."""

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


def adaptation_frame(means: Mapping[str, FloatArray], names: Sequence[str]) -> pd.DataFrame:
    """Return the mean over the models of each adaptation: adaptation, own_*, best_*; intervals hold for all at once."""
    level = LEVEL / (len(means) * len(names))
    columns = {against: [numbers_of(said, f"{against}_") for said in stated(y, level)] for against, y in means.items()}
    both = zip(names, *columns.values(), strict=True)
    table = pd.DataFrame([{"adaptation": name, **own, **best} for name, own, best in both])
    return table.sort_values("own_ratio", kind="stable", ignore_index=True)


def by_trace(rows: AuditRows, average: FloatArray) -> dict[str, float]:
    """Return the ratio on the drives that replay each receiver's errors, of log ratios (D,): `average_over_drives`."""
    judged = rows.drives.set_index("seed").loc[list(rows.protocol.seeds_to_judge_on)]
    drawn = judged.filter(regex=rf"^{re.escape(TRACE)}").notna()
    return {
        str(name).removeprefix(TRACE): float(np.exp(average[own].mean())) for name, own in drawn.items() if own.any()
    }


def steps(rows: AuditRows, losses: Losses) -> "pd.Series[float]":
    """Return what each step brings: the error relative to the first plain filter at its defaults."""
    protocol, first = rows.protocol, rows.protocol.filters[0]
    level = rows.drives.set_index("seed")["level"].loc[list(protocol.seeds_to_judge_on)].to_numpy()
    best, more, pick = picked(losses)
    of = {
        f"{first}, tuned": losses.plains[0],
        "the best plain filter of all models, tuned": best,
        f"the same with {protocol.plain_trials} settings tried": more,
        "the adaptation that leads, tuned": pick,
    }
    return pd.Series({step: float(np.exp((own - level).mean())) for step, own in of.items()})


def told_truth(answer: AuditAnswer) -> dict[str, float]:
    """Return the ratio of each reference, which is told the truth, to the plain filter of its model, by its name."""
    protocol, plains = answer.rows.protocol, answer.losses.plains
    ratios: dict[str, float] = {}
    for name in protocol.references:
        told = [AuditMethod(model, name) for model in protocol.filters]
        differences = (cubes(answer.rows, told).tuned - plains).mean(axis=(1, 2))
        ratios |= {method.name: float(ratio) for method, ratio in zip(told, np.exp(differences), strict=True)}
    return ratios


ELSEWHERE = ("journeys", "vehicles", "attitude")
"""Studies beside the audit, of real recordings; what each found stands in its folder, in `FOUND`."""
FOUND = "answer.md"
SECOND = "second.md"
"""What an audit with other drives and tunings had in common, where it was compared."""
SHOWN = 15
"""Methods in the table of worst cases."""


def write_page(answer: AuditAnswer, folder: Path, commit: str) -> None:
    """Write README.md and its pictures into ``folder``."""
    protocol, margin = answer.rows.protocol, answer.rows.protocol.margin
    kinds, methods = (of.assign(name=of["filter"] + " + " + of["adaptation"]) for of in (answer.kinds, answer.methods))
    save_figure(kinds_figure(kinds, methods, margin), folder / "kinds.png")
    _, _, own, best = comparisons(answer.losses)
    of_models = (len(protocol.filters), len(protocol.compared), *own.shape[1:])
    means = {"own": own.reshape(of_models).mean(axis=0), "best": best.reshape(of_models).mean(axis=0)}
    by_kind = kind_frame(means["own"], [{"adaptation": name} for name in protocol.compared], answer.rows)
    kinds, adaptations = (t.assign(name=t["adaptation"]) for t in (by_kind, adaptation_frame(means, protocol.compared)))
    save_figure(kinds_figure(kinds, adaptations, margin), folder / "answer.png")
    write_text(folder / "README.md", audit_page(answer, folder, commit))


def audit_page(answer: AuditAnswer, folder: Path, commit: str) -> str:
    """Return the page as Markdown; what was found elsewhere is read beside ``folder``."""
    rows, methods, average = answer.rows, answer.methods, average_over_drives(answer.losses)
    protocol, status = rows.protocol, rows.judged["status"].astype(str)
    levels = rows.judged["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    return worded(
        HERE / "page.md.jinja",
        answer=answer,
        steps=steps(rows, answer.losses),
        at_costs={cost: statements(losses_of(rows, cost)) for cost in protocol.lost_costs_shown},
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


def reweighted_text(rows: AuditRows, mixture: str) -> str:
    """Say what the audit would say of another mixture."""
    said = reweighted(rows, losses_of(rows), mixture)
    methods = list(zip(rows.protocol.methods, said.own_plain, strict=True))
    return worded(HERE / "reweighted.md.jinja", mixture=mixture, p=rows.protocol, said=said, methods=methods)


def main() -> None:
    """Write the page of an audit, or print its answer for another mixture of faults."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the audit, for example results/audit-full")
    parser.add_argument(
        "--reweight", metavar="KIND=SHARE", help="print the answer for another share of a kind of fault"
    )
    chosen = parser.parse_args()
    if chosen.reweight:
        print(reweighted_text(read_rows(chosen.folder), chosen.reweight))
    else:
        write_page(answered(read_rows(chosen.folder)), chosen.folder, read_audit_manifest(chosen.folder)["git_commit"])


if __name__ == "__main__":
    main()
