"""The figures of an audit: ratios by method, by severity of a fault, by family of faults, and by model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import TUNED, Losses, MethodVerdict
from jerkbench.campaigns.protocol import HALVES
from jerkbench.report.plots.style import OKABE_ITO, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

from matplotlib.colors import LogNorm

from jerkbench.audit.verdicts import FamilyVerdict
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.plots.style import DOTS_PER_INCH

WIDTH_IN = 7.0

MOST_LINES = 6
"""Methods in a figure of severities: the best ones."""


def ratio_figure(verdicts: Sequence[MethodVerdict], margin: float) -> Figure:
    """Draw the ratio of each method to its tuned plain filter with its interval; a circle stands for the defaults."""
    figure = Figure(figsize=(WIDTH_IN, 0.2 * len(verdicts) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    rows = np.arange(len(verdicts))[::-1]
    tuned = [verdict.tuned for verdict in verdicts]
    axes.axvspan(1 / (1 + margin), 1 + margin, color="0.9", label=f"equal (within {100 * margin:g} %)")
    axes.hlines(rows, [t.low for t in tuned], [t.high for t in tuned], color=OKABE_ITO[0], linewidth=1.2)
    axes.plot([t.ratio for t in tuned], rows, "o", color=OKABE_ITO[0], markersize=4, label="tuned, scored unseen, 95 %")
    axes.plot(
        [v.default for v in verdicts], rows, "o", color="C1", markerfacecolor="none", markersize=4, label="defaults"
    )
    axes.set_xscale("log")
    axes.set_ylim(-1, len(rows))
    style_axes(axes)
    axes.set_yticks(rows, [verdict.method.name for verdict in verdicts])
    axes.set_xlabel("Position RMSE / tuned plain filter")
    figure.legend(loc="outside lower center", ncols=3, fontsize="small")
    return figure


def audit_severity_figure(known: Losses, verdicts: Sequence[MethodVerdict], protocol: AuditProtocol) -> Figure:
    """Draw the ratio of the best methods against the severity of each family, mean over fields and seeds."""
    families = [family for family in protocol.families if family.half in HALVES]
    columns = 3
    lines = -(-len(families) // columns)
    figure = Figure(figsize=(WIDTH_IN, 1.8 * lines + 0.8), layout="constrained")
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    best = [verdict.method for verdict in verdicts[:MOST_LINES]]
    for axes, family in zip(panels, families, strict=False):
        axes.set_title(family.name, fontsize="small")
        for method, colour in zip(best, OKABE_ITO, strict=False):
            _draw_family(axes, known, method, protocol, family.name, colour)
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        axes.set_yscale("log")
        style_axes(axes)
    for axes in panels[len(families) :]:
        axes.set_axis_off()
    figure.supylabel("Position RMSE / tuned plain filter", fontsize="small")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize="small")
    return figure


def _draw_family(
    axes: "Axes", known: Losses, method: AuditMethod, protocol: AuditProtocol, family: str, colour: str
) -> None:
    plain = AuditMethod(method.filter, protocol.plain)
    difference = (known.by_kind[method, TUNED, 0] - known.by_kind[plain, TUNED, 0]).mean(axis=1)
    words = list(dict.fromkeys(scenario.severity for scenario in known.scenarios if scenario.family == family))
    faults = np.array([f"{scenario.family} {scenario.severity}" for scenario in known.scenarios])
    ratios = [float(np.exp(difference[faults == f"{family} {word}"].mean())) for word in words]
    axes.plot(words, ratios, "o-", color=colour, label=method.name, markersize=3)
    axes.tick_params(labelsize="x-small")


FARTHEST = 5.0
"""The colour goes no further than five times better or worse."""

DARK = 2.5
"""From this ratio on, or its inverse, the field is so dark that its number is white."""


def family_figure(verdicts: Sequence[FamilyVerdict]) -> Figure:
    """Draw each ratio to the tuned plain filter: blue is better, red is worse; bold was shown, grey was not."""
    methods = list(dict.fromkeys(verdict.method for verdict in verdicts))
    families = list(dict.fromkeys(verdict.family for verdict in verdicts))
    ratios = np.array([verdict.ratio for verdict in verdicts]).reshape(len(methods), len(families))
    size = (3.6 + 0.5 * len(families), 1.9 + 0.2 * len(methods))
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    scale = LogNorm(1 / FARTHEST, FARTHEST, clip=True)
    image = axes.imshow(ratios, cmap="RdBu_r", norm=scale, aspect="auto")
    for (row, column), verdict in zip(np.ndindex(*ratios.shape), verdicts, strict=True):
        weight, colour = _ink(verdict)
        axes.text(
            column, row, f"{verdict.ratio:.2g}", ha="center", va="center", fontsize=6.5, weight=weight, color=colour
        )
    axes.set_xticks(range(len(families)), families, rotation=90, fontsize=8)
    axes.set_yticks(range(len(methods)), [method.name for method in methods], fontsize=7)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[0.2, 0.5, 1, 2, 5], format="%g", shrink=0.5)
    bar.minorticks_off()
    bar.set_label("Position RMSE / tuned plain filter; bold: shown", fontsize=8)
    return figure


def _ink(verdict: FamilyVerdict) -> tuple[str, str]:
    """Weight and colour of a number."""
    shown = verdict.verdict is not Verdict.UNDECIDED
    dark = not 1 / DARK < verdict.ratio < DARK
    return "bold" if shown else "normal", "white" if dark else "black" if shown else "0.35"


MARKS = "osD^vP"
TICKS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0)


def model_figure(verdicts: Sequence[MethodVerdict], margin: float) -> Figure:
    """Draw the tuned ratio of each adaptation on each model, a line an adaptation, sorted by their means."""
    ratios = ratios_by_adaptation(verdicts)
    figure = Figure(figsize=(WIDTH_IN, 0.2 * len(ratios) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    rows = np.arange(len(ratios))[::-1]
    axes.axvspan(1 / (1 + margin), 1 + margin, color="0.9", label=f"equal (within {100 * margin:g} %)")
    axes.hlines(
        rows,
        [min(own.values()) for own in ratios.values()],
        [max(own.values()) for own in ratios.values()],
        color="0.75",
        linewidth=1.0,
    )
    models = list(dict.fromkeys(verdict.method.filter for verdict in verdicts))
    for model, mark, colour in zip(sorted(models), MARKS, OKABE_ITO, strict=False):
        values = [own.get(model, np.nan) for own in ratios.values()]
        axes.plot(values, rows, mark, color=colour, markersize=4.5, label=model)
    axes.set_xscale("log")
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.set_xticks([], minor=True)
    axes.set_ylim(-1, len(ratios))
    style_axes(axes)
    axes.set_yticks(rows, list(ratios))
    axes.set_xlabel("RMSE / plain filter of the same model, tuned alike, scored unseen")
    figure.legend(loc="outside lower center", ncols=5, fontsize="small")
    return figure


def ratios_by_adaptation(verdicts: Sequence[MethodVerdict]) -> dict[str, dict[str, float]]:
    """Return the tuned ratio of each adaptation by model, the lowest geometric mean first."""
    ratios: dict[str, dict[str, float]] = {}
    for verdict in verdicts:
        ratios.setdefault(verdict.method.adaptation, {})[verdict.method.filter] = verdict.tuned.ratio
    return dict(sorted(ratios.items(), key=lambda item: float(np.mean(np.log(list(item[1].values()))))))
