"""The figure of methods by families of faults: where adapting helps, and where it harms."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.audit.family_verdicts import FamilyVerdict
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.plots.style import DOTS_PER_INCH

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
