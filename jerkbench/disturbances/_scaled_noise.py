"""Measurement noise that is larger than reported."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances._added_errors import Measured, reported_covariance, values_of, with_errors
from jerkbench.disturbances._draws import own_stream
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording

Factor = Callable[[FloatArray, np.random.Generator], FloatArray]
"""From the times (m,) and a random stream to the factor k (m,) on the standard deviation, at least 1."""


def with_scaled_noise(recording: Recording, seed: int, disturbance: str, label: str, factor: Factor) -> Recording:
    """Return the recording with noise on position and velocity that makes their standard deviations ``factor``-fold.

    Raises:
        RecordingError: it has neither.
    """
    if recording.position is None and recording.velocity is None:
        raise RecordingError(
            f"{recording.name} has neither position nor velocity, so {disturbance} finds no noise to raise; leave it"
            " out."
        )
    of_position, of_velocity = (own_stream(seed, disturbance, label, part) for part in ("position", "velocity"))
    return replace(
        recording,
        position=_scaled(recording.position, factor, of_position),
        velocity=_scaled(recording.velocity, factor, of_velocity),
    )


def _scaled(measured: Measured | None, factor: Factor, random: np.random.Generator) -> Measured | None:
    """Add noise of covariance (k^2 - 1) R; noise that has R already then has k^2 R."""
    if measured is None:
        return None
    excess = factor(measured.t_s, random) ** 2 - 1.0
    R = reported_covariance(measured)
    present = np.isfinite(values_of(measured))
    block = np.where(present[:, :, None] & present[:, None, :], R, np.eye(3))
    unit = np.einsum("mij,mj->mi", np.linalg.cholesky(block), random.standard_normal((len(R), 3)))
    return with_errors(measured, np.sqrt(excess)[:, None] * unit, excess[:, None, None] * R)
