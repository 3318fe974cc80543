"""The figure of an audit on one screen: each adaptation once, with a mark for every model."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jerkbench.audit.verdicts import MethodVerdict
from jerkbench.report.plots.style import OKABE_ITO, quiet

WIDTH_IN = 7.0
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
    quiet(axes)
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
