"""The waterfall of an attribution: from the naive filter to the whole, factor by factor."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jerkbench.audit.attribution.shares import Share
from jerkbench.report.plots.style import MEASURED, OKABE_ITO, quiet

GAIN, LOSS = OKABE_ITO[2], OKABE_ITO[1]


def waterfall(rows: Sequence[Share], start: str, end: str) -> Figure:
    """Draw what each factor multiplies the RMSE by.

    Args:
        rows: shares in order, the whole last.
        start: what the naive filter is called.
        end: what the whole is called.
    """
    *factors, whole = rows
    steps = np.log([row.ratio.ratio for row in factors])
    ends = np.exp(np.concatenate([[0.0], np.cumsum(steps)]))
    figure = Figure(figsize=(7.0, 0.42 * (len(rows) + 1) + 0.8), layout="constrained")
    axes = figure.add_subplot()
    places = np.arange(len(rows) + 1)[::-1]
    for place, before, after in zip(places[1:-1], ends, ends[1:], strict=False):
        axes.barh(place, after - before, left=before, color=GAIN if after < before else LOSS, height=0.6)
        axes.vlines(after, place - 1.0, place, color=MEASURED, linewidth=0.8)
    axes.plot([1.0, whole.ratio.ratio], [places[0], places[-1]], "o", color=OKABE_ITO[0])
    axes.set_xscale("log")
    quiet(axes)
    axes.set_yticks(places, [start, *(f"{row.factor}, {row.ratio.ratio:.2f}" for row in factors), end])
    axes.set_xlabel(f"Position RMSE / {start}")
    return figure
