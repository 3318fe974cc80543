"""The tilt filter over a recording, and its start: rest, or level when it moves from the beginning.

The state is x = Omega^T e3, the vertical of ENU seen from the body; at rest the accelerometer shows g x.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.tilt_kernel import ADAPTATIONS, Settings, make_room, run_samples
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.module_cache import can_compile
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording


class TiltParameters(NamedTuple):
    """What a step needs besides the data; the defaults are those of a field robot.

    Attributes:
        sigma_gyro_radps: noise of one gyro sample.
        sigma_accel_mps2: noise of one accelerometer sample.
        external_memory: c_a, the part of the external acceleration that is expected to last to the next sample.
        window: mu, over how many samples mtf takes the mean of e_i^2.
        normalise: whether x is brought back to length 1 after each update.
        exact: whether Phi is the rotation itself, or its first-order form.
        adapt: one of `tilt_kernel.ADAPTATIONS`.
    """

    sigma_gyro_radps: float = 0.0017
    sigma_accel_mps2: float = 0.02
    external_memory: float = 0.0
    window: int = 1
    normalise: bool = True
    exact: bool = False
    adapt: str = "mtf"


class TiltStart(NamedTuple):
    """Where the filter starts.

    Attributes:
        x: (3,) Omega^T e3.
        variance: diagonal of its covariance.
    """

    x: FloatArray
    variance: float


def run_tilt(
    start: TiltStart, gyro_radps: FloatArray, accel_mps2: FloatArray, dt_s: FloatArray, p: TiltParameters
) -> tuple[FloatArray, BoolArray]:
    """Run the filter over n samples; returns x (n, 3) after each of them, and whether it triggered (n,).

    Compiled; with NUMBA_DISABLE_JIT=1 the same loop runs as it is, some hundred times slower.
    """
    x, triggered = np.empty((len(dt_s), 3)), np.empty(len(dt_s), dtype=np.bool_)
    arrays = (np.require(array, np.float64, ["C", "W", "A"]) for array in (gyro_radps, accel_mps2, dt_s))
    with np.errstate(all="ignore"):
        _loop()(make_room(start.x, start.variance, p.window), *arrays, settings_of(p), x, triggered)
    return x, triggered


def settings_of(p: TiltParameters) -> Settings:
    """Return the parameters in numbers."""
    noise = float(p.sigma_gyro_radps), float(p.sigma_accel_mps2), float(p.external_memory)
    return Settings(*noise, bool(p.normalise), bool(p.exact), ADAPTATIONS.index(p.adapt))


def roll_pitch(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roll and pitch [rad] of x (..., 3): roll = atan2(x2, x3), pitch = atan2(-x1, hypot(x2, x3))."""
    return np.arctan2(x[..., 1], x[..., 2]), np.arctan2(-x[..., 0], np.hypot(x[..., 1], x[..., 2]))


def _loop() -> Callable[..., None]:
    """The loop, compiled where numba may compile."""
    return _compiled() if can_compile() else run_samples


@cache
def _compiled() -> Callable[..., None]:
    return compiled_loop(run_samples, "the tilt filter", kernel=False)


# The start of the tilt filter: the mean of the first second of rest, or level when it moves from
# the start.

ALIGNMENT_S = 1.0
"""The rest that the alignment uses at most, and needs at least."""

STATIC_VARIANCE = 1e-3
LEVEL_VARIANCE = 0.03


def align(recording: Recording, variance: float | None) -> TiltStart:
    """Return the state before the first sample.

    At rest for the first second: x is the normalised mean of its specific force, P = 1e-3 I. Moving: x = (0, 0, 1),
    P = 0.03 I. ``variance`` replaces either of the two.

    Raises:
        RecordingError: the accelerometer shows no gravity in the first second.
    """
    if recording.static_start_s < ALIGNMENT_S:
        return TiltStart(np.array([0.0, 0.0, 1.0]), LEVEL_VARIANCE if variance is None else variance)
    imu = recording.inertial
    mean = imu.accel_mps2[imu.t_s < imu.t_s[0] + ALIGNMENT_S].mean(axis=0)
    norm = float(np.linalg.norm(mean))
    if not norm > 0:
        raise RecordingError(
            f"{recording.name}: the accelerometer's mean over the first second is zero, so that no tilt can be read"
            " from it; specific force must contain gravity."
        )
    return TiltStart(mean / norm, STATIC_VARIANCE if variance is None else variance)
