"""The tilt filter over samples.

The state is x = Omega^T e3, the vertical of ENU seen from the body; at rest the accelerometer shows g x.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.alignment import TiltStart
from jerkbench.attitude.common import loop_arrays
from jerkbench.attitude.tilt_kernel import ADAPTATIONS, Settings, make_room, run_samples
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.module_cache import can_compile


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


def run_tilt(
    start: TiltStart, gyro_radps: FloatArray, accel_mps2: FloatArray, dt_s: FloatArray, p: TiltParameters
) -> tuple[FloatArray, BoolArray]:
    """Run the filter over n samples; returns x (n, 3) after each of them, and whether it triggered (n,).

    Compiled; with NUMBA_DISABLE_JIT=1 the same loop runs as it is, some hundred times slower.
    """
    x, triggered = np.empty((len(dt_s), 3)), np.empty(len(dt_s), dtype=np.bool_)
    arrays = loop_arrays(gyro_radps, accel_mps2, dt_s)
    with np.errstate(all="ignore"):
        _loop()(make_room(start.x, start.variance, p.window), *arrays, settings_of(p), x, triggered)
    return x, triggered


def settings_of(p: TiltParameters) -> Settings:
    """Return the parameters in numbers."""
    noise = float(p.sigma_gyro_radps), float(p.sigma_accel_mps2), float(p.external_memory)
    return Settings(*noise, bool(p.normalise), bool(p.exact), ADAPTATIONS.index(p.adapt))


def _loop() -> Callable[..., None]:
    """The loop, compiled where numba may compile."""
    return _compiled() if can_compile() else run_samples


@cache
def _compiled() -> Callable[..., None]:
    return compiled_loop(run_samples, "the tilt filter", kernel=False)
