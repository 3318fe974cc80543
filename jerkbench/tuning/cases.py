"""The runs of a tuning: those to tune on, those to choose on and those to score on, which share none."""

from collections.abc import Sequence
from dataclasses import dataclass

from jerkbench.cells.cell import Cell
from jerkbench.errors import PluginError

PARTS = ("tune", "choose", "test")


@dataclass(frozen=True, eq=False)
class TuningCase:
    """A scenario with the draws that are run of it.

    Attributes:
        cell: the scenario with the method as it is before the search.
        draws: seeds, or phases of a decimation.
        fingerprint: of its data.
    """

    cell: Cell
    draws: tuple[int, ...]
    fingerprint: str

    @property
    def scenario(self) -> str:
        """What tables call it."""
        labels = self.cell.labels
        return f"{labels.dataset}, {labels.disturbance}, {labels.attitude}"


@dataclass(frozen=True, eq=False)
class Cases:
    """The cases of a tuning.

    Attributes:
        tune: on which every setting is tried.
        choose: on which the best of them are tried again, and one is chosen; empty: the best on ``tune`` is.
        test: on which the chosen one is scored.
        split: how they were told apart, one phrase.
    """

    tune: tuple[TuningCase, ...]
    choose: tuple[TuningCase, ...]
    test: tuple[TuningCase, ...]
    split: str


def require_cases(cells: Sequence[Cell]) -> None:
    """Check that the cells are scenarios of one method.

    Raises:
        PluginError: there is none, or they differ in filter, adaptation, noise or engine.
    """
    if not cells:
        raise PluginError("There is no scenario to tune on; give dataset=... and disturbance=...")
    first = cells[0]
    for cell in cells:
        for name in ("filter", "adaptation", "r_scale", "engine"):
            if getattr(cell, name) != getattr(first, name):
                raise PluginError(f"A tuning is of one method, but its scenarios have different values of {name}.")
