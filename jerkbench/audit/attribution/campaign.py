"""The runs of the attribution: each method tuned in Q, in R, in both and not at all, with either attitude."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.attribution.factors import ATTITUDE, SUBSETS, methods_of, subset_settings
from jerkbench.audit.attribution.shapley import Corner
from jerkbench.audit.campaign import seeds_of
from jerkbench.audit.methods import Method
from jerkbench.audit.protocol import HALVES, AuditProtocol
from jerkbench.audit.scenarios import Scenario
from jerkbench.audit.searches import best_trials, by_method, levels_of, losses, mean_losses, seen
from jerkbench.audit.stages import Stages
from jerkbench.tuning.space import Setting, Space

CORNERS = "corners"
"""The stage of the runs that score."""

Chosen = Mapping[tuple[Method, Corner, str], Setting]
"""The setting of a method by what was tuned of it, and on which half."""


@dataclass(frozen=True)
class Scored:
    """The runs of one attitude.

    Attributes:
        rows: of the test; ``trial`` is the place of a setting among those of `trial_keys`.
        trial_keys: (subset, half that it was tuned on) of each trial, by scenario.
    """

    rows: pd.DataFrame
    trial_keys: Sequence[Sequence[tuple[Corner, str]]]


class AttributionRuns:
    """The runs with one attitude, which go on where they were stopped."""

    def __init__(self, protocol: AuditProtocol, spaces: Mapping[Method, Space], stages: Stages) -> None:
        """Prepare to search the ``spaces``, which begin from the naive values."""
        self._protocol, self._spaces, self._stages = protocol, spaces, stages

    def scored(self) -> Scored:
        """Tune, and score what came out on the half that it was not tuned on."""
        chosen = self._tuned()
        trial_keys = [_keys_of(scenario) for scenario in self._stages.scenarios]
        settings = [
            {method: tuple(chosen[method, *key] for key in keys) for method in self._spaces} for keys in trial_keys
        ]
        return Scored(self._stages.run(CORNERS, seeds_of(self._protocol).test, settings), trial_keys)

    def _tuned(self) -> Chosen:
        tried = {
            (method, subset): subset_settings(space, subset, self._protocol.trials)
            for (method, space), subset in product(self._spaces.items(), SUBSETS)
        }
        union = {method: _union([tried[method, subset] for subset in SUBSETS]) for method in self._spaces}
        rows = self._stages.run("tune", seeds_of(self._protocol).tune, [union] * len(self._stages.scenarios))
        rows["loss"] = losses(rows, levels_of(rows, self._protocol.plain))
        grouped = by_method(rows)
        return {
            (method, subset, half): self._best(grouped[method], union[method], own, half)
            for ((method, subset), own), half in product(tried.items(), HALVES)
        }

    def _best(self, rows: pd.DataFrame, union: Sequence[Setting], own: Sequence[Setting], half: str) -> Setting:
        trials = [union.index(setting) for setting in own]
        means = mean_losses(rows[rows["trial"].isin(trials)], seen(half, self._stages.scenarios))
        return union[best_trials(means, 1)[0]]


def _union(several: Sequence[Sequence[Setting]]) -> tuple[Setting, ...]:
    return tuple(dict.fromkeys(setting for settings in several for setting in settings))


def _keys_of(scenario: Scenario) -> list[tuple[Corner, str]]:
    """What is scored in a scenario: each subset, tuned on the half or the halves that the scenario is not of."""
    halves = [half for half in HALVES if half != scenario.half]
    return [(subset, half) for subset in SUBSETS for half in halves]


def corner_values(scored: Mapping[bool, Scored], protocol: AuditProtocol) -> dict[Corner, FloatArray]:
    """Return (S, n) the loss at every corner; of a scenario of both halves the mean of both settings.

    Args:
        scored: of the attitude off and on.
        protocol: of the study.
    """
    levels = levels_of(scored[True].rows, protocol.plain)
    values = {}
    for on, own in scored.items():
        attitude = frozenset({ATTITUDE} if on else ())
        rows = by_method(own.rows.assign(loss=losses(own.rows, levels)))
        for corner, method in methods_of(protocol).items():
            cube = rows[method].pivot_table(index=["scenario", "trial"], columns="seed", values="loss")
            for subset in SUBSETS:
                values[corner | attitude | subset] = _of_subset(cube, own.trial_keys, subset)
    return values


def _of_subset(cube: pd.DataFrame, trial_keys: Sequence[Sequence[tuple[Corner, str]]], subset: Corner) -> FloatArray:
    wanted = [[(number, k) for k, key in enumerate(keys) if key[0] == subset] for number, keys in enumerate(trial_keys)]
    return np.array([cube.loc[places].to_numpy().mean(axis=0) for places in wanted])
