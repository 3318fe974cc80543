"""Covariances that claim more, or less, than is so."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import Once, true_covariance
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Velocity


@register("disturbance", "stated_covariance")
@dataclass(frozen=True)
class StatedCovariance(Once):
    """Only what is reported changes: standard deviations of position and velocity are stated k times as large.

    R' = k^2 R, values and R_true as they were (where nothing better is known, R_true is the R reported before).
    k below 1 is a receiver that boasts, above 1 one that is modest.

    Attributes:
        position_factor: k of position.
        velocity_factor: k of velocity.
    """

    seeded: ClassVar[bool] = False

    position_factor: float = 0.2
    velocity_factor: float = 1.0

    def __post_init__(self) -> None:
        """Check that the factors are positive."""
        for name in ("position_factor", "velocity_factor"):
            if not 0 < getattr(self, name) < np.inf:
                raise PluginError(f"{name} is {getattr(self, name)}; a standard deviation must stay positive.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with other reported covariances.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        if recording.position is None and recording.velocity is None:
            raise RecordingError(
                f"{recording.name} has neither position nor velocity, of which something could be stated."
            )
        return replace(
            recording, position=self._position(recording.position), velocity=self._velocity(recording.velocity)
        )

    def _position(self, position: Position | None) -> Position | None:
        if position is None:
            return None
        R = self.position_factor**2 * position.covariance_m2
        return replace(position, covariance_m2=R, true_covariance_m2=true_covariance(position))

    def _velocity(self, velocity: Velocity | None) -> Velocity | None:
        if velocity is None:
            return None
        R = self.velocity_factor**2 * velocity.covariance_m2ps2
        return replace(velocity, covariance_m2ps2=R, true_covariance_m2ps2=true_covariance(velocity))
