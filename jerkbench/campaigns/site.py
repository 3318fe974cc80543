"""Where a campaign's settings are run over its scenarios: what is stored is not run again."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from jerkbench.campaigns.entrant import LIMITS, Entrant, knobs_of
from jerkbench.campaigns.protocol import Scenario
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.cell import Cell, Protocol
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.progress import Progress
from jerkbench.results.parts import parsed
from jerkbench.results.store import Store
from jerkbench.sweep.sweep import joined_plan, planned, rows_of, run_sweep
from jerkbench.sweep.tasks import Planned
from jerkbench.tuning.space import Setting

NUMBERS = ("position_rmse_m", "anees")
"""What is kept of a run that navigates."""

TOGETHER = 20_000
"""So many settings are planned at once: their cells are in memory."""


class Try(NamedTuple):
    """A setting of a method that is run over a scenario.

    Attributes:
        number: of the scenario.
        scenario: the scenario.
        entrant: the method.
        setting: of its knobs.
        trial: what its rows are found by.
        seeds: of its runs.
    """

    number: int
    scenario: Scenario
    entrant: Entrant
    setting: Setting
    trial: int
    seeds: Sequence[int]


@dataclass(frozen=True)
class Rules:
    """How the runs of a campaign are made and judged.

    Attributes:
        metrics: what is computed.
        limits: how each run is judged.
        attitude: name of the plugin; None: that of the data set.
        strict: whether a run that failed, for another reason than that the filter diverged, is an error.
        numbers: columns that are kept of a run.
    """

    metrics: tuple[str, ...]
    limits: Protocol = LIMITS
    attitude: str | None = None
    strict: bool = False
    numbers: tuple[str, ...] = NUMBERS


@dataclass(frozen=True)
class Site:
    """Where settings are run and stored.

    Attributes:
        folder: of what is stored.
        workers: who runs them; None: this process.
        only_stored: read what other code may have computed, and run nothing.
    """

    folder: Path
    workers: Workers | None = None
    only_stored: bool = False

    def rows(self, tries: Iterable[Try], rules: Rules, bar: Progress) -> pd.DataFrame:
        """Run the settings that are not stored yet, and return the rows of all, in their order.

        Args:
            tries: those of one scenario together, and there those of one method.
            rules: how they are run.
            bar: is told of every setting that is done.

        Returns:
            scenario, filter, adaptation, trial, seed, status, reason, the numbers of the rules, seconds.

        Raises:
            JerkbenchError: a run failed, or is not stored and may not be run.
            OSError: nothing can be stored.
        """
        parts: list[pd.DataFrame] = []
        waiting: list[Try] = []
        for _, of_scenario in groupby(tries, attrgetter("number")):
            waiting += of_scenario
            if len(waiting) >= TOGETHER:
                parts.append(self._rows(waiting, rules, bar))
                waiting = []
        if waiting:
            parts.append(self._rows(waiting, rules, bar))
        return pd.concat(parts, ignore_index=True)

    def missing(self, tries: Sequence[Try], rules: Rules) -> list[Try]:
        """Return the settings of which no run is stored, whatever code computed it."""
        rows = rows_of(_planned(tries, rules), Store(self.folder), (), any_code=True)
        return [tries[place] for place in rows.loc[rows["status"].isna(), "place"].unique()]

    def makers(self) -> list[str]:
        """Return the code and the versions of the libraries that computed what is stored."""
        made = Store(self.folder).makers()
        return sorted(f"{parsed(code)} {sorted(parsed(versions).items())}" for code, versions in made)

    def _rows(self, tries: Sequence[Try], rules: Rules, bar: Progress) -> pd.DataFrame:
        jobs, store = _planned(tries, rules), Store(self.folder)
        if not self.only_stored:
            run_sweep(joined_plan(jobs), store, self.workers, strict=rules.strict, progress=bar)
            store.compact()
        rows = rows_of(jobs, store, rules.numbers, any_code=self.only_stored)
        if rows["status"].isna().any():
            lost = tries[rows.loc[rows["status"].isna(), "place"].iloc[0]]
            raise JerkbenchError(
                f"Of {len(rows)} runs in {self.folder}, {rows['status'].isna().sum()} are missing or of other settings,"
                f" first one of {lost.entrant.name} in {lost.scenario.name}; run the audit without --stored."
            )
        return _named(rows, tries, rules.numbers)


def _planned(tries: Sequence[Try], rules: Rules) -> list[Planned]:
    cells: list[tuple[Cell, Sequence[int]]] = []
    for _, own in groupby(tries, lambda each: (each.number, each.entrant.text)):
        several = list(own)
        first = several[0]
        cell = first.entrant.cell(first.scenario, rules.limits, rules.metrics, rules.attitude)
        space = knobs_of(cell)
        cells += [(space.applied(cell, each.setting), each.seeds) for each in several]
    return planned(cells)


def _named(rows: pd.DataFrame, tries: Sequence[Try], numbers: tuple[str, ...]) -> pd.DataFrame:
    """Return the rows of tries with what campaigns find them by."""
    heads = [(each.number, each.entrant.filter["name"], each.entrant.adaptation["name"], each.trial) for each in tries]
    head = pd.DataFrame(heads, columns=["scenario", "filter", "adaptation", "trial"])
    named = head.iloc[rows["place"].to_numpy()].reset_index(drop=True)
    named[["seed", "status", "reason"]] = rows[["seed", "status", "reason"]]
    named[list(numbers)] = rows[list(numbers)].astype(float)
    return named.assign(seconds=rows["run_s"])
