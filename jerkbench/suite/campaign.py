"""The campaign of an entrant: settings are tried on some drives, and the best one is scored on others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.contracts import ReadingFile
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.key import plugin_digest
from jerkbench.jobs.progress import Progress
from jerkbench.suite.protocol import TUNED_ON, SuiteProtocol
from jerkbench.tuning.entrant import NUMBERS, Entrant, RunRules, Site, Try, knobs_of, tried_settings
from jerkbench.tuning.evaluate import LOST_RUN
from jerkbench.tuning.space import Setting

AS_GIVEN = "given"
"""The setting that a method came with."""

SUITE_ERROR = NUMBERS[0]
"""The column of the error."""

PLAIN, ENTRY = "plain", "entry"
"""Whose a row is."""


@dataclass(frozen=True)
class ScoredEntrant:
    """An entrant after its campaign.

    Attributes:
        settings: values by knob, by what they were tuned on: "given", and "drives" where it could be tuned.
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
        self.space = knobs_of(entrant.job(protocol.scenario, protocol.limits))
        self._tried = tried_settings(protocol.trials, self.space)

    def tuned(self) -> pd.DataFrame:
        """Return the rows of every setting on the seeds to tune on."""
        return self._run(self._tried, self._protocol.seeds_to_tune_on, self._protocol.rules(1))

    def scored(self, levels: Mapping[int, float]) -> ScoredEntrant:
        """Search where there is something to search, and score what came out.

        Args:
            levels: error of the plain filter on each drive, in the unit of the error.
        """
        settings = {AS_GIVEN: self._tried[0], **({TUNED_ON: self._best(levels)} if self.space.knobs else {})}
        rows = self._run(tuple(settings.values()), self._protocol.seeds_to_test_on, self._protocol.rules())
        rows.insert(0, "tuned_on", [list(settings)[trial] for trial in rows["trial"]])
        named = {name: dict(zip(self.space.names, own, strict=True)) for name, own in settings.items()}
        return ScoredEntrant(named, rows.drop(columns="trial"))

    def _best(self, levels: Mapping[int, float]) -> Setting:
        """The setting whose mean loss over the drives is lowest."""
        rows = self.tuned()
        means = suite_losses(rows, levels).groupby(rows["trial"]).mean()
        return self._tried[int(means.sort_values(kind="stable").index[0])]

    def _run(self, settings: Sequence[Setting], seeds: tuple[int, ...], rules: RunRules) -> pd.DataFrame:
        scenario = self._protocol.scenario
        tries = [Try(0, scenario, self._entrant, setting, trial, seeds) for trial, setting in enumerate(settings)]
        with Progress(len(tries), doing=self._doing, unit="settings") as bar:
            return self._place.rows(tries, rules, bar)


def plugins_digest(entrant: Entrant, protocol: SuiteProtocol) -> str:
    """Return the hash of the code of an entrant's plugins and of its program; empty for our own.

    Raises:
        RecordingError: the program, or a file that the filter reads, is not on this machine.
    """
    method = entrant.job(protocol.scenario, protocol.limits).method
    model = method.filter
    program = model.fingerprint() if isinstance(model, ReadingFile) else ""
    return plugin_digest(type(model)) + plugin_digest(type(method.adaptation)) + program


def scored_plain(protocol: SuiteProtocol, place: Site) -> tuple[dict[int, float], ScoredEntrant]:
    """Return the error of the plain filter at its defaults on each drive [m], and the plain filter tuned and scored."""
    campaign = SuiteCampaign(protocol.plain_entrant, protocol, place, "The plain filter")
    levels = suite_levels(campaign.tuned())
    return levels, campaign.scored(levels)


def suite_levels(rows: pd.DataFrame) -> dict[int, float]:
    """Return the level of each drive: the error of trial 0 of the plain filter.

    Raises:
        JerkbenchError: it was lost on some drive.
    """
    own = rows[(rows["trial"] == 0) & (rows["status"] == "ok")]
    levels = dict(zip(own["seed"].astype(int), own[SUITE_ERROR].astype(float), strict=True))
    if missing := sorted(set(rows["seed"]) - set(levels)):
        raise JerkbenchError(f"The plain filter was lost on the drive of seed {missing[0]}; make its fault milder.")
    return levels


def suite_losses(rows: pd.DataFrame, levels: Mapping[int, float]) -> "pd.Series[float]":
    """Return the loss of each run: log(error / its level), at most log 100, which a lost run counts."""
    level = rows["seed"].map(dict(levels)).to_numpy()
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(rows[SUITE_ERROR].to_numpy() / level)
    lost = (rows["status"] != "ok").to_numpy() | ~np.isfinite(log)
    return pd.Series(np.minimum(np.where(lost, LOST_RUN, log), LOST_RUN), index=rows.index)
