"""The cases of a tuning: what a setting is tuned on, and what it is scored on, which the search never sees."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from jerkbench.errors import PluginError
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.key import data_fingerprint
from jerkbench.renamed import new_name
from jerkbench.tuning.excerpts import Excerpt

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


MOST_SEEDS = 100_000
"""Seeds of one part, as a cell has at most so many runs."""


@dataclass(frozen=True)
class Seeds:
    """Numbers of seeds; they follow each other from ``first`` on, so that no two parts share one.

    Attributes:
        tune: to try every setting on.
        choose: to choose among the best; 0: none.
        test: to score on.
        first: the first of them.
    """

    tune: int = 16
    choose: int = 16
    test: int = 40
    first: int = 0

    def __post_init__(self) -> None:
        """Check that there is something to tune on, and something to score on."""
        if self.tune < 1 or self.test < 1 or self.choose < 0 or self.first < 0:
            raise PluginError(
                f"tune_seeds is {self.tune}, choose_seeds {self.choose}, test_seeds {self.test} and first_seed"
                f" {self.first}; at least one seed to tune and one to test are needed, and none is negative."
            )

        if max(self.tune, self.choose, self.test) > MOST_SEEDS:
            raise PluginError(
                f"tune_seeds is {self.tune}, choose_seeds {self.choose} and test_seeds {self.test}; give at most"
                f" {MOST_SEEDS} of each."
            )

    @property
    def parts(self) -> tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
        """The seeds to tune, to choose and to test on."""
        begin, middle = self.first + self.tune, self.first + self.tune + self.choose
        return tuple(range(self.first, begin)), tuple(range(begin, middle)), tuple(range(middle, middle + self.test))


def by_seeds(cells: Sequence[Cell], seeds: Seeds) -> Cases:
    """Return the same scenarios with other seeds.

    Raises:
        PluginError: a scenario has nothing random.
    """
    require_cases(cells)
    for cell in cells:
        if not cell.seeded:
            raise PluginError(
                f"Nothing in {cell.labels.dataset} with {cell.labels.disturbance} is random, so other seeds would be"
                " the same run: use split=time, or split=recordings."
            )
    tune, choose, test = seeds.parts
    words = f"seeds {_span(tune)} to tune, {_span(choose) or 'none'} to choose, {_span(test)} to test"
    return Cases(_cases(cells, tune), _cases(cells, choose) if choose else (), _cases(cells, test), words)


def by_time(cells: Sequence[Cell], seeds: Seeds, share: float = 0.5) -> Cases:
    """Return the first part of each recording to tune on, and the rest to test on.

    While tuning the recording ends at ``share`` of its duration: nothing later is in it. The test runs over all of it,
    and errors count from there on.
    """
    require_cases(cells)
    if not 0 < share < 1:
        raise PluginError(f"The share of the time to tune on is {share:g}; it must lie between 0 and 1.")
    tune, test = (
        _cases([_cut(cell, Excerpt(share, late=late)) for cell in cells], seeds.parts[0]) for late in (False, True)
    )
    return Cases(tune, (), test, f"the first {100 * share:g} % of the time to tune, the rest to test")


def by_group(cells: Sequence[Cell], held_out: Sequence[bool], seeds: Seeds, words: str) -> Cases:
    """Return some scenarios to tune on, and others, of which the search sees nothing, to test on.

    Args:
        cells: the scenarios.
        held_out: (len(cells),) whether each is to test on.
        seeds: of those with anything random, disjoint as well.
        words: how they were told apart.

    Raises:
        PluginError: one of the two is empty.
    """
    require_cases(cells)
    seen = [cell for cell, held in zip(cells, held_out, strict=True) if not held]
    unseen = [cell for cell, held in zip(cells, held_out, strict=True) if held]
    if not seen or not unseen:
        raise PluginError(f"A split by {words} needs scenarios on both sides; there are {len(seen)} and {len(unseen)}.")
    tune, choose, test = seeds.parts
    if not all(cell.seeded for cell in seen):
        choose = ()
    return Cases(_cases(seen, tune), _cases(seen, choose) if choose else (), _cases(unseen, test), words)


def by_families(cells: Sequence[Cell], held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return the scenarios whose disturbance is none of ``held_out`` to tune on, and those of ``held_out`` to test on.

    Where nothing is wrong (`none`) a setting has to be good as well: it is on both sides.
    """
    held_out = [new_name("disturbance", name) for name in held_out]
    held = [cell.labels.disturbance in held_out for cell in cells]
    words = f"family: tuned without {', '.join(held_out)}, scored on these"
    cases = by_group(cells, held, seeds, words)
    nominal = [cell for cell in cells if cell.labels.disturbance == "none" and "none" not in held_out]
    return dataclasses.replace(cases, test=cases.test + _cases(nominal, seeds.parts[2]))


def by_recordings(cells: Sequence[Cell], held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return the scenarios over other recordings than ``held_out`` (labels of data sets) to tune on."""
    held_out = [new_name("dataset", name) for name in held_out]
    held = [cell.labels.dataset in held_out for cell in cells]
    return by_group(cells, held, seeds, f"recording: tuned without {', '.join(held_out)}, scored on these")


def _cases(cells: Sequence[Cell], draws: tuple[int, ...]) -> tuple[TuningCase, ...]:
    return tuple(
        TuningCase(cell, draws if cell.seeded else tuple(cell.draws), data_fingerprint(cell.dataset, cell.disturbances))
        for cell in cells
    )


def _cut(cell: Cell, excerpt: Excerpt) -> Cell:
    spec = {**cell.spec, "disturbance": [*cell.spec["disturbance"], {"name": "excerpt", **dataclasses.asdict(excerpt)}]}
    return dataclasses.replace(cell, spec=spec, disturbances=(*cell.disturbances, excerpt))


def _span(draws: Sequence[int]) -> str:
    return f"{draws[0]} to {draws[-1]}" if draws else ""
