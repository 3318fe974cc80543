"""Where a campaign's settings are run over its scenarios: what is stored is not run again."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from jerkbench.campaigns.entrant import LIMITS, Entrant, knobs_of
from jerkbench.campaigns.protocol import FaultScenario
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.plan import Plan, joined_jobs, sharing_scenarios
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.run import run_missing
from jerkbench.results.store import Store
from jerkbench.tuning.space import Setting

NUMBERS = ("position_rmse_m", "anees")
"""What is kept of a run that navigates."""

TOGETHER = 20_000
"""So many settings are planned at once: their jobs are in memory."""


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
    scenario: FaultScenario
    entrant: Entrant
    setting: Setting
    trial: int
    seeds: Sequence[int]


@dataclass(frozen=True)
class RunRules:
    """How the runs of a campaign are made and judged.

    Attributes:
        metrics: what is computed.
        limits: how each run is judged.
        numbers: columns that are kept of a run.
    """

    metrics: tuple[str, ...]
    limits: Protocol = LIMITS
    numbers: tuple[str, ...] = NUMBERS


@dataclass(frozen=True)
class Site:
    """Where settings are run and stored.

    Attributes:
        folder: of what is stored.
        workers: who runs them; None: this process.
    """

    folder: Path
    workers: Workers | None = None

    def rows(self, tries: Iterable[Try], rules: RunRules, bar: Progress) -> pd.DataFrame:
        """Run the settings that are not stored yet, and return the rows of all, in their order.

        Args:
            tries: those of one scenario together, and there those of one method.
            rules: how they are run.
            bar: is told of every setting that is done.

        Returns:
            scenario, filter, adaptation, trial, seed, status, reason, the numbers of the rules, seconds.

        Raises:
            JerkbenchError: nothing can be stored, or the cluster cannot go on.
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

    def _rows(self, tries: Sequence[Try], rules: RunRules, bar: Progress) -> pd.DataFrame:
        jobs, store = _jobs(tries, rules), Store(self.folder)
        run_missing(Plan(joined_jobs(jobs)), store, self.workers, progress=bar)
        store.compact()
        rows = store.rows(jobs, rules.numbers)
        return _named(rows, tries, rules.numbers)


def _jobs(tries: Sequence[Try], rules: RunRules) -> list[Job]:
    jobs: list[Job] = []
    for _, own in groupby(tries, lambda each: (each.number, each.entrant.text)):
        several = list(own)
        first = several[0]
        job = first.entrant.job(first.scenario, rules.limits, rules.metrics)
        space = knobs_of(job)
        jobs += [replace(space.applied(job, each.setting), draws=each.seeds) for each in several]
    return sharing_scenarios(jobs)


def _named(rows: pd.DataFrame, tries: Sequence[Try], numbers: tuple[str, ...]) -> pd.DataFrame:
    """Return the rows of tries with what campaigns find them by."""
    heads = [(each.number, each.entrant.filter["name"], each.entrant.adaptation["name"], each.trial) for each in tries]
    head = pd.DataFrame(heads, columns=["scenario", "filter", "adaptation", "trial"])
    named = head.iloc[rows["place"].to_numpy()].reset_index(drop=True)
    named[["seed", "status", "reason"]] = rows[["seed", "status", "reason"]]
    named[list(numbers)] = rows[list(numbers)].astype(float)
    return named.assign(seconds=rows["run_s"])
