"""The stages of an audit: which settings of each method run over which scenario, and their rows."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd

from jerkbench.audit.methods import AuditMethod
from jerkbench.campaigns.entrant import ERROR
from jerkbench.campaigns.protocol import HALVES, FaultScenario
from jerkbench.campaigns.search import ALL
from jerkbench.campaigns.site import RunRules, Site, Try
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.progress import Progress
from jerkbench.tuning.space import Setting

TEST = "test"
TITLES = {"tune": "settings tried", "choose": "finalists", TEST: "scored unseen"}

Settings = Mapping[AuditMethod, tuple[Setting, ...]]
"""What is run of each method."""

Trials = Mapping[AuditMethod, tuple[int, ...]]
"""Places of settings, of each method; 0 are its defaults."""

LookedAt = Callable[[str, Iterable[FaultScenario]], list[int]]
"""The numbers of the scenarios that belong to what a search was tuned on: `seen` or `unseen`."""


class Search(NamedTuple):
    """A search of one method.

    Attributes:
        method: what is tuned.
        tuned_on: "first", "second", or "all".
        restart: which scramble.
    """

    method: AuditMethod
    tuned_on: str
    restart: int


def searches(methods: Iterable[AuditMethod], restarts: int) -> list[Search]:
    """Return every search: each method on each half with each scramble, and once on all with the first."""
    halves = [(half, restart) for half in HALVES for restart in range(restarts)]
    return [Search(method, *how) for method in methods for how in (*halves, (ALL, 0))]


@dataclass(frozen=True)
class Stages:
    """The place where stages are run and stored.

    Attributes:
        scenarios: of the audit, in order.
        place: where runs are done and stored.
        attitude: name of the plugin; None: that of the data set.
    """

    scenarios: Sequence[FaultScenario]
    place: Site
    attitude: str | None = None

    def run(
        self,
        name: str,
        seeds: tuple[int, ...],
        settings: Sequence[Settings],
        needed: Sequence[Trials] | None = None,
    ) -> pd.DataFrame:
        """Run the ``settings`` of each scenario that are not stored yet, and return the rows of all.

        Args:
            name: of the stage.
            seeds: of the runs.
            settings: of each scenario.
            needed: which of them are run; default: all. ``trial`` of a row is the place among all of them.

        Raises:
            JerkbenchError: a run failed, or is not stored and may not be run.
            OSError: nothing can be stored.
        """
        if needed is None:
            needed = [{method: tuple(range(len(own))) for method, own in of.items()} for of in settings]
        count = sum(len(trials) for of in needed for trials in of.values())
        with Progress(count, doing=f"Audit, {TITLES.get(name, name)}", unit="settings and scenarios") as bar:
            rows = self.place.rows(self._tries(seeds, settings, needed), self._rules(name), bar)
        return rows.drop(columns="reason")

    def stored_methods(self, methods: Sequence[AuditMethod], seeds: tuple[int, ...]) -> list[AuditMethod]:
        """Return those of the ``methods`` that were run on ``seeds``: adaptations may have come into the tree since.

        Raises:
            JerkbenchError: none was.
        """
        first = self.scenarios[0]
        tries = [Try(0, first, method.entrant, method.space(first).start, 0, seeds) for method in methods]
        missing = {each.entrant.name for each in self.place.missing(tries, self._rules("tune"))}
        if stored := [method for method in methods if method.name not in missing]:
            return stored
        raise JerkbenchError(
            f"No run of this audit is stored in {self.place.folder}; run the audit without --stored first."
        )

    def _rules(self, name: str) -> RunRules:
        return RunRules((ERROR, "consistency") if name == TEST else (ERROR,), attitude=self.attitude, strict=True)

    def _tries(self, seeds: tuple[int, ...], settings: Sequence[Settings], needed: Sequence[Trials]) -> Iterator[Try]:
        for number, (scenario, all_of, trials) in enumerate(zip(self.scenarios, settings, needed, strict=True)):
            for method, own in trials.items():
                entrant = method.entrant
                yield from (Try(number, scenario, entrant, all_of[method][trial], trial, seeds) for trial in own)


def needed_trials(
    trials: Mapping[Search, Iterable[int]],
    methods: Iterable[AuditMethod],
    scenarios: Sequence[FaultScenario],
    of: LookedAt,
) -> list[Trials]:
    """Return for each scenario the defaults and the ``trials`` of those searches that it belongs to.

    What no verdict reads is not run: a setting that was tuned on one half is scored on the other half alone.
    """
    needed = [{method: {0} for method in methods} for _ in scenarios]
    for search, own in trials.items():
        for number in of(search.tuned_on, scenarios):
            needed[number][search.method].update(own)
    return [{method: tuple(sorted(own)) for method, own in by_method.items()} for by_method in needed]
