"""The campaign of an entrant: settings tried on each half of the faults, the best of each scored on the other half."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from jerkbench.audit.protocol import HALVES
from jerkbench.audit.searches import best_trials, levels_of, losses, mean_losses, seen
from jerkbench.cells.provenance import code_digest, plugin_digest, versions
from jerkbench.clusters.cluster import Cluster
from jerkbench.clusters.scenario_dispatch import done_by_scenario
from jerkbench.execution.progress import Progress
from jerkbench.suite.entrant import (
    Entrant,
    entrant_cell,
    entrant_settings,
    entrant_space,
    plain_of,
    program_digest,
)
from jerkbench.suite.pieces import Piece
from jerkbench.suite.protocol import SuiteProtocol
from jerkbench.tuning.space import Setting

GIVEN = "given"
"""The setting that a method came with."""

PLAIN, ENTRY = "plain", "entry"
"""Whose a row is."""


@dataclass(frozen=True)
class Place:
    """Where runs are done and stored.

    Attributes:
        folder: of what is stored.
        cluster: what runs them.
        workers: number of processes, where the cluster starts them.
    """

    folder: Path
    cluster: Cluster
    workers: int


@dataclass(frozen=True)
class Scored:
    """An entrant after its campaign.

    Attributes:
        settings: by what they were tuned on: "given", and where it could be tuned "first" and "second".
        rows: of the test: tuned_on, scenario, seed, status, reason, metrics, seconds.
    """

    settings: Mapping[str, Setting]
    rows: pd.DataFrame


class Campaign:
    """The campaign of one entrant, which goes on where it was stopped."""

    def __init__(self, entrant: Entrant, protocol: SuiteProtocol, place: Place, doing: str) -> None:
        """Prepare it; ``doing`` names it beside the bar.

        Raises:
            JerkbenchError: the entrant cannot be made.
        """
        self.space = entrant_space(entrant, protocol)
        self._entrant, self._protocol, self._place, self._doing = entrant, protocol, place, doing
        self._cell = entrant_cell(entrant, protocol.scenarios[0], protocol)
        self._tried = entrant_settings(self.space, protocol)
        code = code_digest("audit", "suite", "tuning")
        self._key = f"{code} {sorted(versions().items())} {plugins_digest(entrant, protocol)}"

    def tuned(self) -> pd.DataFrame:
        """Return the rows of every setting on the seeds to tune on."""
        protocol = self._protocol
        return self._run([self._tried] * len(protocol.scenarios), protocol.seeds_to_tune_on, protocol.metrics[:1])

    def scored(self, levels: Mapping[int, float]) -> Scored:
        """Search where there is something to search, and score what came out.

        Args:
            levels: of each scenario, what the plain filter has in it [m].
        """
        settings = {GIVEN: self._tried[0], **(self._searched(levels) if self.space.knobs else {})}
        halves = [half_settings(settings, scenario.half) for scenario in self._protocol.scenarios]
        by_scenario = [tuple(own.values()) for own in halves]
        rows = self._run(by_scenario, self._protocol.seeds_to_test_on, self._protocol.metrics)
        names = [list(own) for own in halves]
        where = zip(rows["scenario"], rows["trial"], strict=True)
        rows.insert(0, "tuned_on", [names[scenario][trial] for scenario, trial in where])
        return Scored(settings, rows.drop(columns="trial"))

    def _searched(self, levels: Mapping[int, float]) -> dict[str, Setting]:
        rows = self.tuned()
        rows["loss"] = losses(rows, levels)
        means = {half: mean_losses(rows, seen(half, self._protocol.scenarios)) for half in HALVES}
        return {half: self._tried[best_trials(of, 1)[0]] for half, of in means.items()}

    def _run(
        self, settings: Sequence[tuple[Setting, ...]], seeds: tuple[int, ...], metrics: tuple[str, ...]
    ) -> pd.DataFrame:
        pieces = [
            Piece(number, self._entrant, self.space, own, seeds, metrics, self._protocol, self._place.folder, self._key)
            for number, own in enumerate(settings)
        ]
        left = [piece for piece in pieces if not piece.done]
        with Progress(len(pieces), len(pieces) - len(left), self._doing, "scenarios") as progress:
            for _ in self._done(left):
                progress.advance()
        return pd.concat([piece.read() for piece in pieces], ignore_index=True)

    def _done(self, pieces: Sequence[Piece]) -> Iterable[pd.DataFrame]:
        if not pieces:
            return ()
        return done_by_scenario(Piece.run, pieces, [self._cell], self._place.cluster, self._place.workers)


def half_settings(settings: Mapping[str, Setting], half: str) -> dict[str, Setting]:
    """Return what is scored in a scenario of ``half``: the setting as given, and what was tuned without that half."""
    return {name: setting for name, setting in settings.items() if name != half}


def plugins_digest(entrant: Entrant, protocol: SuiteProtocol) -> str:
    """Return the hash of the code of an entrant's plugins and of its program; empty for our own."""
    cell = entrant_cell(entrant, protocol.scenarios[0], protocol)
    plugins = "".join(plugin_digest(type(part)) for part in (cell.filter, cell.adaptation))
    return plugins + program_digest(entrant, protocol)


def scored_plain(protocol: SuiteProtocol, place: Place) -> tuple[dict[int, float], Scored]:
    """Return what the plain filter has in each scenario as it comes [m], and the plain filter tuned and scored."""
    campaign = Campaign(plain_of(protocol), protocol, place, "The plain filter")
    levels = suite_levels(campaign.tuned())
    return levels, campaign.scored(levels)


def suite_levels(rows: pd.DataFrame) -> dict[int, float]:
    """Return the level of each scenario: what trial 0 of the plain filter has, geometric mean over its runs [m].

    Raises:
        JerkbenchError: it was lost in all runs of some scenario.
    """
    return levels_of(rows.assign(filter=PLAIN, adaptation=PLAIN), PLAIN)
