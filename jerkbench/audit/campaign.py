"""The campaign of an audit: every setting on the seeds to tune on, finalists on others, the chosen ones on the last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from jerkbench.audit.methods import AuditMethod, by_method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stages import TEST, LookedAt, Search, Settings, Stages, Trials, needed_trials, searches
from jerkbench.campaigns.entrant import tried_settings
from jerkbench.campaigns.search import best_trials, levels_of, losses, mean_losses, seen, unseen
from jerkbench.tuning.space import Setting, Space


@dataclass(frozen=True)
class Outcome:
    """What came out of a campaign.

    Attributes:
        chosen: the setting of each search.
        trial: of each search: the place of its setting among those of its method in ``test``; the defaults are 0.
        bound: of each method: the place of the setting that was best for the scenario itself.
        test: a row a run, on seeds that no search has seen.
    """

    chosen: Mapping[Search, Setting]
    trial: Mapping[Search, int]
    bound: Mapping[AuditMethod, int]
    test: pd.DataFrame


class AuditCampaign:
    """The three stages, each of which goes on where it was stopped."""

    def __init__(self, protocol: AuditProtocol, spaces: Mapping[AuditMethod, Space], stages: Stages) -> None:
        """Prepare to search the ``spaces`` of the methods."""
        self._protocol, self._spaces, self._stages = protocol, spaces, stages
        self._restarts = {
            method: [tried_settings(protocol.trials, space, restart) for restart in range(protocol.restarts)]
            for method, space in spaces.items()
        }
        self._tried = {
            method: tuple(dict.fromkeys(setting for settings in own for setting in settings))
            for method, own in self._restarts.items()
        }

    def run(self) -> Outcome:
        """Search, choose and score."""
        tuned = self._losses("tune", self._protocol.seeds_to_tune_on, self._tried)
        finalists = {search: self._finalists(tuned, search) for search in self._searches()}
        common = {method: self._union(method, finalists) for method in self._spaces}
        again = self._losses("choose", self._protocol.seeds_to_choose_on, common, self._needed(finalists, common, seen))
        chosen = {search: self._best(again, search, own, common) for search, own in finalists.items()}
        return self._scored(tuned, chosen)

    def _searches(self) -> list[Search]:
        return searches(self._spaces, self._protocol.restarts)

    def _losses(
        self, name: str, seeds: tuple[int, ...], settings: Settings, needed: Sequence[Trials] | None = None
    ) -> dict[AuditMethod, pd.DataFrame]:
        """Run what is needed of the same settings on every scenario; returns each method's rows with their loss."""
        rows = self._stages.run(name, seeds, [settings] * len(self._stages.scenarios), needed)
        rows["loss"] = losses(rows, levels_of(rows, self._protocol.plain))
        return by_method(rows)

    def _finalists(self, tuned: Mapping[AuditMethod, pd.DataFrame], search: Search) -> tuple[Setting, ...]:
        """The best settings of a search on the seeds to tune on."""
        tried = self._tried[search.method]
        own = {tried.index(setting) for setting in self._restarts[search.method][search.restart]}
        rows = tuned[search.method]
        means = mean_losses(rows[rows["trial"].isin(own)], seen(search.tuned_on, self._stages.scenarios))
        return tuple(tried[trial] for trial in best_trials(means, self._protocol.finalists))

    def _union(self, method: AuditMethod, settings: Mapping[Search, tuple[Setting, ...]]) -> tuple[Setting, ...]:
        """The settings of all searches of a method, each once; the defaults first."""
        own = [setting for search, several in settings.items() if search.method == method for setting in several]
        return tuple(dict.fromkeys([self._spaces[method].start, *own]))

    def _best(
        self,
        again: Mapping[AuditMethod, pd.DataFrame],
        search: Search,
        finalists: tuple[Setting, ...],
        common: Settings,
    ) -> Setting:
        settings, rows = common[search.method], again[search.method]
        trials = [settings.index(setting) for setting in finalists]
        means = mean_losses(rows[rows["trial"].isin(trials)], seen(search.tuned_on, self._stages.scenarios))
        return settings[best_trials(means, 1)[0]]

    def _scored(self, tuned: Mapping[AuditMethod, pd.DataFrame], chosen: Mapping[Search, Setting]) -> Outcome:
        """Score the defaults, the chosen settings, and as a bound what was best for each scenario itself."""
        several = {search: (setting,) for search, setting in chosen.items()}
        common = {method: self._union(method, several) for method in self._spaces}
        settings = [
            {method: (*own, self._best_for(tuned[method], method, number)) for method, own in common.items()}
            for number in range(len(self._stages.scenarios))
        ]
        needed = [
            {method: (*trials, len(common[method])) for method, trials in by_method.items()}
            for by_method in self._needed(several, common, unseen)
        ]
        test = self._stages.run(TEST, self._protocol.seeds_to_test_on, settings, needed)
        trial = {search: common[search.method].index(setting) for search, setting in chosen.items()}
        return Outcome(chosen, trial, {method: len(own) for method, own in common.items()}, test)

    def _needed(
        self, several: Mapping[Search, Sequence[Setting]], common: Settings, looked_at: LookedAt
    ) -> list[Trials]:
        """The places of the ``several`` settings of each search among the ``common`` ones, where it is looked at."""
        places = {search: [common[search.method].index(s) for s in settings] for search, settings in several.items()}
        return needed_trials(places, common, self._stages.scenarios, looked_at)

    def _best_for(self, rows: pd.DataFrame, method: AuditMethod, scenario: int) -> Setting:
        return self._tried[method][best_trials(mean_losses(rows, [scenario]), 1)[0]]
