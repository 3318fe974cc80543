"""The tilt filter over a recording, compiled; same inputs and results as `jerkbench.attitude.tilt.run_tilt`."""

from functools import cache
from typing import Any

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.external_acceleration import ADAPTATIONS
from jerkbench.attitude.tilt import TiltParameters, TiltState
from jerkbench.attitude.tilt_kernel import Room, Settings, make_room, run_samples
from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.jitted import jitted
from jerkbench.compilation.module_cache import load_entry

SOURCE = '''"""Made by jerkbench: the loop of the tilt filter."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry(room, seen, gyro, accel, dt, settings, x, triggered):
    loop(room, seen, gyro, accel, dt, settings, x, triggered)
'''


def run_tilt_compiled(
    start: TiltState, gyro_radps: FloatArray, accel_mps2: FloatArray, dt_s: FloatArray, p: TiltParameters
) -> tuple[FloatArray, BoolArray]:
    """Run the filter over n samples; returns x (n, 3) after each of them, and whether it triggered (n,)."""
    x, triggered = np.empty((len(dt_s), 3)), np.empty(len(dt_s), dtype=np.bool_)
    noise = float(p.sigma_gyro_radps), float(p.sigma_accel_mps2), float(p.external_memory)
    settings = Settings(*noise, bool(p.normalise), bool(p.exact), ADAPTATIONS.index(p.adapt))
    room = make_room(start.x, start.P, start.a_prev, start.squares, p.window)
    given = (np.require(array, np.float64, ["C", "W", "A"]) for array in (gyro_radps, accel_mps2, dt_s))
    _loop()(room, len(start.squares), *given, settings, x, triggered)
    return x, triggered


@cache
def _loop() -> Any:  # noqa: ANN401 - numba has no types
    def namespace(home: str) -> dict[str, Any]:
        return {"loop": jitted(run_samples, home), "signature": _signature()}

    return load_entry("the tilt filter", SOURCE, digest(run_samples), namespace).entry


def _signature() -> Any:  # noqa: ANN401 - numba has no types
    """The exact type of the loop: only such a one is found on the disk by the next process."""
    from numba import types

    f, vector, matrix = types.float64, types.float64[::1], types.float64[:, ::1]
    room = types.NamedTuple([vector, matrix, vector, *[matrix] * 4, *[vector] * 3], Room)
    settings = types.NamedTuple([f, f, f, types.boolean, types.boolean, types.int64], Settings)
    return types.void(room, types.int64, matrix, matrix, vector, settings, matrix, types.boolean[::1])
