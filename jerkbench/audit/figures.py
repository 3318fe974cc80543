"""The figures of an audit: every method's ratio, and the ratio against the severity of a fault."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from jerkbench.audit.methods import Method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import TUNED, Losses, MethodVerdict
from jerkbench.campaigns.protocol import HALVES
from jerkbench.report.plots.style import OKABE_ITO, quiet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    quiet(axes)
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
        quiet(axes)
    for axes in panels[len(families) :]:
        axes.set_axis_off()
    figure.supylabel("Position RMSE / tuned plain filter", fontsize="small")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize="small")
    return figure


def _draw_family(
    axes: "Axes", known: Losses, method: Method, protocol: AuditProtocol, family: str, colour: str
) -> None:
    plain = Method(method.filter, protocol.plain)
    difference = (known.by_kind[method, TUNED, 0] - known.by_kind[plain, TUNED, 0]).mean(axis=1)
    words = list(dict.fromkeys(scenario.severity for scenario in known.scenarios if scenario.family == family))
    faults = np.array([f"{scenario.family} {scenario.severity}" for scenario in known.scenarios])
    ratios = [float(np.exp(difference[faults == f"{family} {word}"].mean())) for word in words]
    axes.plot(words, ratios, "o-", color=colour, label=method.name, markersize=3)
    axes.tick_params(labelsize="x-small")
