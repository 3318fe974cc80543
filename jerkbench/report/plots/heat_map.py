"""The figure of methods by scenarios: what is best where, and by how much the others miss it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jerkbench.report.plots.style import literal, new_figure
from jerkbench.report.tables.table_model import Table

WORST = 100.0
"""The colour goes no further than so many times the best."""


def heat_map_figure(table: Table, competing: Sequence[bool]) -> Figure:
    """Draw the cells of ``table``: each number as it is there, its colour by the ratio to the best of its scenario.

    Columns of the table, the methods, make the rows, its rows, the scenarios, the columns. A cell that lost runs has no
    colour and is no best: below its number stands how many it lost. A combination that was not run is an empty field.
    What does not compete is in parentheses, and is no best.
    """
    scenarios = [", ".join(values) for values in table.rows]
    names = [" + ".join(values) for values in table.columns]
    methods = [name if competes else f"({name})" for name, competes in zip(names, competing, strict=True)]
    height = 1.3 + 0.085 * max(map(len, scenarios)) + 0.24 * len(methods)
    figure = new_figure(height, 2.2 + 0.085 * max(map(len, methods)) + 0.56 * len(scenarios))
    axes = figure.add_subplot()
    whole = np.array([[cell.mean if cell and cell.complete else np.nan for cell in row] for row in table.cells])
    best = np.where(np.isfinite(whole) & np.asarray(competing), whole, np.inf).min(axis=1, keepdims=True)
    ratio = whole / best
    image = axes.imshow(np.clip(ratio, 1.0, WORST).T, cmap="cividis_r", norm=LogNorm(1.0, WORST), aspect="auto")
    for p, row in enumerate(table.cells):
        for s, cell in enumerate(row):
            if cell is None:
                continue
            look = {"color": "white" if ratio[p, s] > 10 else "black", "fontsize": 7.0}
            if competing[s] and whole[p, s] == best[p]:
                look["weight"] = "bold"
            text = cell.number
            if lost := cell.diverged + cell.failed:
                text, look = f"{text}\n{lost}/{cell.runs}".strip(), {"color": "#555555", "fontsize": 6.0}
            axes.text(p, s, text, ha="center", va="center", **look)  # type: ignore[arg-type]  # as documented
    axes.set_xticks(range(len(scenarios)), map(literal, scenarios), rotation=90, fontsize=8)
    axes.set_yticks(range(len(methods)), map(literal, methods), fontsize=8)
    axes.set_title(literal(table.title), fontsize="medium")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    bar = figure.colorbar(image, ax=axes, ticks=[1, 2, 5, 10, 20, 50, 100], format="%g")
    bar.set_label(f"Times the best of the scenario (up to {WORST:g})", fontsize=8)
    return figure
