"""Fewer position fixes."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import Phased, rows_of
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "decimate_position")
@dataclass(frozen=True)
class DecimatePosition(Phased):
    """Only every n-th position fix reaches the filter; velocity and reference stay.

    Fix i = 0, 1, 2, ... is kept where i mod every = phase. The phases are the replicates: seed s has the phase
    s mod every.

    Attributes:
        every: n; 1 keeps all.
        phase: the same one for all seeds, below ``every``; None: seed mod every.
    """

    seeded: ClassVar[bool] = False

    every: int = 4
    phase: int | None = None

    def __post_init__(self) -> None:
        """Check that phase and every fit."""
        if self.every < 1:
            raise PluginError(f"every is {self.every}; give 1 (all fixes) or more.")
        self.require_phase()

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the fixes of one phase."""
        position = recording.position
        if position is None:
            return recording
        return replace(
            recording, position=rows_of(position, np.arange(len(position.t_s)) % self.every == self.phase_of(seed))
        )
