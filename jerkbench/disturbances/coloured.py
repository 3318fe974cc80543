"""Measurement noise that is correlated in time (first-order Gauss-Markov)."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import Measured, Once, own_stream, reported_covariance, roots_of, with_errors
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.simulation.imu import gauss_markov


@register("disturbance", "coloured")
@dataclass(frozen=True)
class Coloured(Once):
    """A slow error on top of the noise of position and velocity: a share of the variance then lasts.

    With R as reported and L L' = R, a Gauss-Markov process b(t) of unit variance and f = s/(1 - s)::

        z' = z + sqrt(f) L b(t),  E[b(t) b(t + tau)'] = I exp(-|tau|/T)
        R_true' = R_true + f R,   R' = R + f R where it is reported

    Where the noise of z was white with R, a share s of the new variance R/(1 - s) lasts. Even when it is reported, a
    filter that takes errors for new each time becomes too sure of itself.

    Attributes:
        position_share: s of position, from 0 to below 1.
        position_time_s: T of position.
        velocity_share: s of velocity; 0: it stays as it is.
        velocity_time_s: T of velocity.
        reported: whether the reported covariance grows as well.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    position_share: float = 0.8
    position_time_s: float = 10.0
    velocity_share: float = 0.0
    velocity_time_s: float = 2.0
    reported: bool = True
    stream: str = ""

    def __post_init__(self) -> None:
        """Check shares and times."""
        for name in ("position_share", "velocity_share"):
            if not 0 <= getattr(self, name) < 1:
                raise PluginError(f"{name} is {getattr(self, name)}; a share must be from 0 to below 1.")
        for name in ("position_time_s", "velocity_time_s"):
            if not 0 < getattr(self, name) < np.inf:
                raise PluginError(f"{name} is {getattr(self, name)}; a correlation time must be positive.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the slow errors of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        if recording.position is None and recording.velocity is None:
            raise RecordingError(
                f"{recording.name} has neither position nor velocity, so no error can last; leave it out."
            )
        return replace(
            recording,
            position=self._slow(recording.position, "position", seed),
            velocity=self._slow(recording.velocity, "velocity", seed),
        )

    def _slow(self, measured: Measured | None, part: str, seed: int) -> Measured | None:
        share, time_s = getattr(self, f"{part}_share"), getattr(self, f"{part}_time_s")
        if measured is None or not share or not len(measured.t_s):
            return measured
        process = gauss_markov(measured.t_s, time_s, own_stream(seed, "coloured", self.stream, part))
        R = reported_covariance(measured)
        f = share / (1.0 - share)
        errors = np.sqrt(f) * np.einsum("mij,mj->mi", roots_of(measured, R), process)
        return with_errors(measured, errors, f * R, reported_growth=f * R if self.reported else 0.0)
