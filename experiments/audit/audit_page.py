"""The page and the pictures of an audit, from its stored rows.

python experiments/audit/audit_page.py results/audit-full                          writes README.md, answer.png and
                                                                                   kinds.png into this folder
python experiments/audit/audit_page.py results/audit-full --reweight faulty=0.05   prints the answer for another
                                                                                   share of drives with a fault
"""

import argparse
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator
from recompute import Audit

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaign.answer import (
    MIN_DRIVES,
    NO_FAULT,
    AuditAnswer,
    answered,
    counts_of,
    kind_frame,
    kinds_of,
    numbers_of,
)
from jerkbench.campaign.audit import AuditRows, cubes, losses_of, read_audit_manifest, read_rows
from jerkbench.campaign.protocol import PUBLISHED, AuditMethod
from jerkbench.errors import PluginError, unknown
from jerkbench.evaluation.drives_and_tunings import (
    SMALL_MARGIN,
    Losses,
    Statement,
    Statements,
    comparisons,
    picked,
    stated,
    statements,
)
from jerkbench.evaluation.intervals import share_interval
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import filled_template, write_text
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
        "the adaptation that is best in tuning, tuned": pick,
    }
    return pd.Series({step: float(np.exp((own - level).mean())) for step, own in of.items()})


def told_truth(answer: AuditAnswer) -> dict[str, float]:
    """Return the ratio of each reference, which uses the truth, to the plain filter of its model, by its name."""
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
SECOND_AUDIT, SECOND = "audit-second", "second.md"
"""Folder of a second audit, with other drives and other tunings, next to the folder of the first, and a file in the
folder of the first audit with the comparison of the two audits."""
FAULTY, NOTHING_KNOWN, MIN_BAD = "faulty", "nothing known", "the worst kind should be as good as possible"
EQUAL = f"equal within {100 * SMALL_MARGIN:.0f} %"
SHOWN = 15
"""Methods in the table of worst cases."""
MAX_LINE = 140
NOT_TEXT = re.compile(r"\s*(?:\||#|!\[|$)")
"""Lines that are not wrapped: tables, headings, pictures and empty lines."""
ITEM = re.compile(r" *(?:- |\d+\. )")
"""Start of a list item."""
NO_BREAK = "\u00a0"


def sentences(answer: AuditAnswer) -> list[str]:
    """Return the answer: how many beat the plain filter, where the gain comes from, what picking the best brings."""
    rows, losses, methods = answer.rows, answer.losses, answer.methods
    most = main_kind(rows, losses)
    kinds = {str(kind): counts_of(of["verdict"]) for kind, of in answer.kinds.groupby("kind", observed=True)}
    text = worded(
        HERE / "answer.md.jinja",
        said=answer.said,
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
    return [wrapped(f"1. {' '.join(of.split())}").removeprefix("1. ") for of in text.split("\n\n")]


def mixture_weights(member: BoolArray, share: float) -> FloatArray:
    """Return weights of drives (D,), as if ``share`` of all were those that are ``member``: of another mixture.

    Raises:
        PluginError: the share is none, or there are no such drives: what was never drawn cannot be added.
    """
    count = np.array([member.sum(), (~member).sum()])
    shares = np.array([share, 1.0 - share])
    if not 0.0 <= share <= 1.0 or (shares[count == 0] > 0).any():
        raise PluginError(
            f"{count[0]} of {count.sum()} drives are of that kind, so its share cannot be {share:g}; give one from 0 to"
            " 1, of what was drawn."
        )
    each = shares / np.maximum(count, 1)
    return np.asarray(np.where(member, each[0], each[1]))


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
    halves = {kind: own for kind, own in halves.items() if min(own[0].sum(), own[1].sum()) >= MIN_DRIVES}

    def told(when: str, pick: int, other: BoolArray) -> dict[str, object]:
        said = stated(y[:, :, other], LEVEL)[pick]
        return {"when": when, "take": methods[pick].name, "drives": int(other.sum()), **numbers_of(said)}

    means = {kind: y[:, :, own].mean(axis=(1, 2)) for kind, (own, _) in halves.items()}
    lines = [told(NOTHING_KNOWN, int(y[:, :, first].mean(axis=(1, 2)).argmin()), ~first)]
    lines += [told(kind, int(means[kind].argmin()), other) for kind, (_, other) in halves.items()]
    if halves:
        least = int(np.max(list(means.values()), axis=0).argmin())
        worst = max((other for _, other in halves.values()), key=lambda other: float(y[least][:, other].mean()))
        lines.append(told(MIN_BAD, least, worst))
    return pd.DataFrame(lines)


def leaders(rows: AuditRows, losses: Losses) -> list[str]:
    """Return the published method that is best on the drives of each tuning."""
    names = np.array([method.name for method in rows.protocol.methods])[losses.picked]
    return [str(names[place]) for place in losses.tuned[losses.picked].argmin(axis=0)]


def main_kind(rows: AuditRows, losses: Losses) -> str:
    """Return the kind of fault that the average adaptation gains most from: without it, least is left of the gain."""
    average = average_over_drives(losses)
    known = {kind: own for kind, own in kinds_of(rows).items() if kind != NO_FAULT and own.sum() >= MIN_DRIVES}
    return max(known, key=lambda kind: float(average[~known[kind]].mean()))


def average_over_drives(losses: Losses) -> FloatArray:
    """Return the log ratio (D,) of the average adaptation on each drive, mean over the tunings."""
    return np.asarray(comparisons(losses)[0][0].mean(axis=0))


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


def counts(said: Sequence[Statement]) -> dict[str, int]:
    """Return how many statements have each verdict."""
    return counts_of(one.verdict for one in said)


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
    return f"less than 10 % {verdict}" if small and verdict != Verdict.UNDECIDED else str(verdict)


def percent(share: float) -> str:
    """Say a share."""
    return f"{100 * share:.0f} %"


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
    page = worded(
        HERE / "page.md.jinja",
        answer=answer,
        sentences=sentences(answer),
        take=take_frame(rows, answer.losses),
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
        most=main_kind(rows, answer.losses),
        again=Audit(again).better_and_worse() if (again := folder.parent / SECOND_AUDIT).exists() else {},
        sources=[(name, of) for name in protocol.compared if (of := provenance_of(plugins.get("adaptation", name)))],
    )
    return wrapped(page)


def wrapped(page: str) -> str:
    """Return a Markdown page without code blocks, with paragraphs and list items wrapped at 140 characters."""
    blocks: list[str] = []
    for line in page.split("\n"):
        if blocks and not any(NOT_TEXT.match(each) for each in (blocks[-1], line)) and not ITEM.match(line):
            blocks[-1] += f" {line.strip()}"
        else:
            blocks.append(line)
    return "\n".join(block if NOT_TEXT.match(block) else _filled(block) for block in blocks)


def _filled(block: str) -> str:
    """Wrap one paragraph or list item. Code, a percentage, and a number with its interval are not divided."""
    item = ITEM.match(block)
    indent = " " * (len(item[0]) if item else len(block) - len(block.lstrip()))
    joined = re.sub(r"`[^`]*`|\d %|\d \[[\d., ]+\]", lambda found: found[0].replace(" ", NO_BREAK), block)
    wrapper = textwrap.TextWrapper(MAX_LINE, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return wrapper.fill(joined).replace(NO_BREAK, " ")


def _by_kind(kinds: pd.DataFrame) -> list[dict[str, Any]]:
    """For each kind of fault: drives, methods better and worse, the lowest and the highest ratio."""
    lines: list[dict[str, Any]] = []
    for kind, own in kinds.groupby("kind"):
        low, high = own.sort_values("ratio").iloc[[0, -1]].to_dict("records")
        lines.append({"kind": kind, "drives": low["drives"], "low": low, "high": high, **counts_of(own["verdict"])})
    return sorted(lines, key=lambda line: (line["kind"] != NO_FAULT, -line["better"], line["worse"]))


def _texts(paths: Iterable[Path]) -> str:
    return "\n\n".join(path.read_text(encoding="utf-8").strip() for path in paths if path.exists())


def compared_text(
    methods: Sequence[AuditMethod], first: Statements, second: Statements, without: Mapping[str, Sequence[Statements]]
) -> str:
    """Return text with the number of verdicts that differ between two audits, and a list of the reversed verdicts.

    The mapping ``without`` contains the statements of both audits about the drives without a kind of fault.
    """
    families = ("own", first.same_model_plain, second.same_model_plain), ("best", first.best_plain, second.best_plain)
    changed = [
        (method.name, against, one.verdict, other.verdict)
        for against, *pair in families
        for method, one, other in zip(methods, *pair, strict=True)
        if one.verdict is not other.verdict
    ]
    opposite = [change for change in changed if {*change[2:]} == {Verdict.BETTER, Verdict.WORSE}]
    turned = f"{len(opposite) or 'No'} verdict{'s are' if len(opposite) > 1 else ' is'}"
    average = "On average over the adaptive filters from the literature, adaptation multiplies the error by"
    best = "the error of the best adaptive filter divided by the error of the best plain filter is"
    sentences = [
        "A second audit repeats the first audit with other simulated drives and other tunings.",
        f"The two audits differ in {len(changed)} of {2 * len(methods)} verdicts about single adaptive filters.",
        f'{turned} "better" in one audit and "worse" in the other audit{", which is a defect" * bool(opposite)}.',
        f"{average} {interval(first.average)} in the first audit.",
        f"In the second audit, adaptation multiplies the error by {interval(second.average)} on average.",
    ]
    for kind, (one, other) in without.items():
        subject = f"On the drives without {kind}, adaptation multiplies the error by"
        sentences.append(f"{subject} {interval(one.average)} in the first audit.")
        sentences.append(f"{subject} {interval(other.average)} in the second audit.")
    sentences.append(f"{best.capitalize()} {interval(first.pick)} in the first audit.")
    sentences.append(f"In the second audit, {best} {interval(second.pick)}.")
    lines = (f"\n- {name}, {against} plain filter: {one}, then {other}" for name, against, one, other in opposite)
    return " ".join(sentences) + "".join(lines)


def reweighted_text(rows: AuditRows, mixture: str) -> str:
    """Say what the audit would say of another mixture."""
    said = reweighted(rows, losses_of(rows), mixture)
    methods = list(zip(rows.protocol.methods, said.same_model_plain, strict=True))
    return worded(HERE / "reweighted.md.jinja", mixture=mixture, p=rows.protocol, said=said, methods=methods)


def main() -> None:
    """Write the page of an audit, or print its answer for another mixture of faults."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the audit, for example results/audit-full")
    parser.add_argument(
        "--reweight", metavar="KIND=SHARE", help="print the answer for another share of a kind of fault"
    )
    parser.add_argument("--second", type=Path, metavar="FOLDER", help="compare with another audit of the same methods")
    chosen = parser.parse_args()
    if chosen.second:
        audits = [read_rows(folder) for folder in (chosen.folder, chosen.second)]
        losses = [losses_of(rows) for rows in audits]
        kind = main_kind(audits[0], losses[0])
        without = {kind: [reweighted(*each, f"{kind}=0") for each in zip(audits, losses, strict=True)]}
        text = compared_text(audits[0].protocol.methods, *map(statements, losses), without)
        write_text(chosen.folder / SECOND, text)
    if chosen.reweight:
        print(reweighted_text(read_rows(chosen.folder), chosen.reweight))
    else:
        write_page(answered(read_rows(chosen.folder)), chosen.folder, read_audit_manifest(chosen.folder)["git_commit"])


if __name__ == "__main__":
    main()
