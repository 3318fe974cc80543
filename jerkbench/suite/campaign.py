"""The campaign of an entrant: settings tried on each half of the faults, the best of each scored on the other half."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.contracts import ReadingFile
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.key import plugin_digest
from jerkbench.jobs.progress import Progress
from jerkbench.suite.protocol import BOTH, SuiteProtocol, domain_of
from jerkbench.tuning.entrant import Entrant, FaultScenario, RunRules, Site, Try, knobs_of, tried_settings
from jerkbench.tuning.evaluate import LOST_RUN
from jerkbench.tuning.space import Setting

AS_GIVEN = "given"
"""The setting that a method came with."""

PLAIN, ENTRY = "plain", "entry"
"""Whose a row is."""


@dataclass(frozen=True)
class ScoredEntrant:
    """An entrant after its campaign.

    Attributes:
        settings: values by knob, by what they were tuned on: "given", and where it could be tuned each search.
        rows: of the test: tuned_on, scenario, seed, status, reason, metrics, seconds.
    """

    settings: Mapping[str, Mapping[str, float]]
    rows: pd.DataFrame


class SuiteCampaign:
    """The campaign of one entrant, which goes on where it was stopped."""

    def __init__(self, entrant: Entrant, protocol: SuiteProtocol, place: Site, doing: str) -> None:
        """Prepare it; ``doing`` names it beside the bar.

        Raises:
            JerkbenchError: the entrant cannot be made.
        """
        self._entrant, self._protocol, self._place, self._doing = entrant, protocol, place, doing
        self.space = knobs_of(entrant.job(protocol.scenarios[0], protocol.limits))
        self._tried = tried_settings(protocol.trials, self.space)

    def tuned(self) -> pd.DataFrame:
        """Return the rows of every setting on the seeds to tune on."""
        protocol = self._protocol
        return self._run([self._tried] * len(protocol.scenarios), protocol.seeds_to_tune_on, protocol.rules(1))

    def scored(self, levels: Mapping[int, float]) -> ScoredEntrant:
        """Search where there is something to search, and score what came out.

        Args:
            levels: of each scenario, what the plain filter has in it, in the unit of the error.
        """
        settings = {AS_GIVEN: self._tried[0], **(self._searched(levels) if self.space.knobs else {})}
        halves = [half_settings(settings, scenario.half) for scenario in self._protocol.scenarios]
        by_scenario = [tuple(own.values()) for own in halves]
        rows = self._run(by_scenario, self._protocol.seeds_to_test_on, self._protocol.rules())
        names = [list(own) for own in halves]
        where = zip(rows["scenario"], rows["trial"], strict=True)
        rows.insert(0, "tuned_on", [names[scenario][trial] for scenario, trial in where])
        named = {name: dict(zip(self.space.names, own, strict=True)) for name, own in settings.items()}
        return ScoredEntrant(named, rows.drop(columns="trial"))

    def _searched(self, levels: Mapping[int, float]) -> dict[str, Setting]:
        """For each search the setting whose mean over scenarios is lowest, where a scenario is a mean over seeds."""
        rows, found = self.tuned(), {}
        rows["loss"] = suite_losses(rows, levels, self._protocol)
        for half in self._protocol.searches:
            own = rows[rows["scenario"].isin(seen(half, self._protocol.scenarios))]
            means = own.groupby(["trial", "scenario"])["loss"].mean().groupby("trial").mean()
            found[half] = self._tried[int(means.sort_values(kind="stable").index[0])]
        return found

    def _run(self, settings: Sequence[tuple[Setting, ...]], seeds: tuple[int, ...], rules: RunRules) -> pd.DataFrame:
        tries = [
            Try(number, scenario, self._entrant, setting, trial, self._protocol.seeds_of(scenario, seeds))
            for number, (scenario, own) in enumerate(zip(self._protocol.scenarios, settings, strict=True))
            for trial, setting in enumerate(own)
        ]
        with Progress(len(tries), doing=self._doing, unit="settings and scenarios") as bar:
            return self._place.rows(tries, rules, bar)


def seen(tuned_on: str, scenarios: Iterable[FaultScenario]) -> list[int]:
    """Return the numbers of the scenarios that a search of ``tuned_on`` looks at."""
    return [k for k, s in enumerate(scenarios) if s.half in (tuned_on, domain_of(tuned_on) + BOTH)]


def half_settings(settings: Mapping[str, Setting], half: str) -> dict[str, Setting]:
    """Return what is scored in a scenario of ``half``: the setting as given, and what was tuned without that half.

    What was tuned on another domain is not scored there.
    """
    own = domain_of(half)
    return {name: of for name, of in settings.items() if name == AS_GIVEN or (name != half and domain_of(name) == own)}


def plugins_digest(entrant: Entrant, protocol: SuiteProtocol) -> str:
    """Return the hash of the code of an entrant's plugins and of its program; empty for our own.

    Raises:
        RecordingError: the program, or a file that the filter reads, is not on this machine.
    """
    job = entrant.job(protocol.scenarios[0], protocol.limits)
    model = job.method.filter
    parts: list[type] = [type(model), type(job.method.adaptation)]
    if entrant.attitude:
        parts.append(type(job.scenario.attitude))
    return "".join(map(plugin_digest, parts)) + (model.fingerprint() if isinstance(model, ReadingFile) else "")


def scored_plain(protocol: SuiteProtocol, place: Site) -> tuple[dict[int, float], ScoredEntrant]:
    """Return what the plain filter has in each scenario as it comes [m], and the plain filter tuned and scored."""
    campaign = SuiteCampaign(protocol.plain_entrant, protocol, place, "The plain filter")
    levels = suite_levels(campaign.tuned(), protocol)
    return levels, campaign.scored(levels)


def suite_levels(rows: pd.DataFrame, protocol: SuiteProtocol) -> dict[int, float]:
    """Return the level of each scenario: what trial 0 of the plain filter has, geometric mean over its runs.

    Raises:
        JerkbenchError: it was lost in all runs of some scenario.
    """
    error, by = protocol.numbers[0], protocol.level_of
    own = rows[(rows["trial"] == 0) & (rows["status"] == "ok")]
    levels = np.exp(np.log(own[error]).groupby(own[by]).mean())
    if missing := sorted(set(rows[by]) - set(levels.index)):
        raise JerkbenchError(f"In {by} {missing[0]} every run of the plain filter was lost; make its fault milder.")
    return {int(place): float(level) for place, level in levels.items()}


def suite_losses(rows: pd.DataFrame, levels: Mapping[int, float], protocol: SuiteProtocol) -> "pd.Series[float]":
    """Return the loss of each run: log(error / its level), at most log 100, which a lost run counts."""
    level = rows[protocol.level_of].map(dict(levels)).to_numpy()
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(rows[protocol.numbers[0]].to_numpy() / level)
    lost = (rows["status"] != "ok").to_numpy() | ~np.isfinite(log)
    return pd.Series(np.minimum(np.where(lost, LOST_RUN, log), LOST_RUN), index=rows.index)
