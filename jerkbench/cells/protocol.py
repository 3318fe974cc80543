"""The protocol of a cell: its seeds, the burn-in, the limit of divergence."""

import dataclasses
import math

from jerkbench.errors import PluginError
from jerkbench.evaluation.divergence import LIMIT_M

MOST_SEEDS = 100_000
"""Runs of one cell: their rows stay in memory until it is stored."""
LAST_SEED = 2**63
"""Before this one: rows hold seeds as signed integers of 64 bits."""


@dataclasses.dataclass(frozen=True)
class Protocol:
    """The protocol of a cell: how it is run and scored.

    Attributes:
        seeds: number of runs of a cell that has anything random.
        first_seed: the first of them.
        burn_in_s: errors count from this time on [s].
        divergence_limit_m: a larger position error is a divergence [m]; infinite: none is. The rule and the
            limit where nothing is said: `jerkbench.evaluation.divergence`.
    """

    seeds: int = 5
    first_seed: int = 0
    burn_in_s: float = 5.0
    divergence_limit_m: float = LIMIT_M

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.seeds < 1:
            raise PluginError(f"seeds is {self.seeds}; at least one run is needed.")
        if self.first_seed < 0:
            raise PluginError(f"first_seed is {self.first_seed}; it must not be negative.")
        if self.seeds > MOST_SEEDS:
            raise PluginError(f"seeds is {self.seeds}; a cell has at most {MOST_SEEDS} runs.")
        if self.first_seed + self.seeds > LAST_SEED:
            raise PluginError(f"first_seed is {self.first_seed}; a seed must be less than 2**63.")
        if not (math.isfinite(self.burn_in_s) and self.burn_in_s >= 0):
            raise PluginError(f"burn_in_s is {self.burn_in_s:g}; it must be a number of seconds, 0 or more.")
        if math.isnan(self.divergence_limit_m) or self.divergence_limit_m <= 0:
            raise PluginError(f"divergence_limit_m is {self.divergence_limit_m:g}; it must be more than 0.")
