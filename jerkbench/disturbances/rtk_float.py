"""RTK that loses its fixed solution and falls back to a float one."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import (
    RegularWindows,
    WindowTimes,
    fixes_of,
    in_any,
    own_stream,
    require_values,
    with_errors,
)
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.simulation.imu import gauss_markov


@register("disturbance", "rtk_float")
@dataclass(frozen=True)
class RtkFloat(RegularWindows):
    """RTK float instead of fixed in the given windows: errors of decimetres that last, honestly reported.

    A Gauss-Markov process b(t), stationary with the given sigmas, is added to the fixes in the windows::

        z' = z + b(t),  E[b(t) b(t + tau)'] = diag(sigma^2) exp(-|tau|/time)
        R' = R + diag(sigma^2),  R_true' = R_true + diag(sigma^2)

    The covariance is honest for one fix, but successive errors are correlated: a filter that takes them for white
    still becomes too confident. One process runs through the whole recording and shows in the windows, so that moving
    a window does not change it.

    Attributes:
        sigma_m: one sigma of b, east, north, up.
        factor: on ``sigma_m``.
        time_s: correlation time.
        stream: label of the random stream; give a second float of either kind in a list another one.
    """

    seeded: ClassVar[bool] = True
    honest: ClassVar[bool] = True
    fault: ClassVar[str] = "float solution"

    windows_s: WindowTimes = ((30.0, 60.0), (95.0, 120.0))
    sigma_m: tuple[float, ...] = (0.25, 0.25, 0.5)
    factor: float = 1.0
    time_s: float = 15.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check windows, sigmas and the time."""
        super().__post_init__()
        require_values(self, ("factor",), lambda k: 0 <= k < np.inf, "give 0 or more.")
        if len(self.sigma_m) != 3 or not all(sigma >= 0 for sigma in self.sigma_m):
            raise PluginError(f"sigma_m is {self.sigma_m}; give three, 0 or more: east, north, up.")
        require_values(self, ("time_s",), lambda time: time > 0, "a correlation time must be positive.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the float solutions of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be float; leave rtk_float out.")
        random = own_stream(seed, "rtk_float", self.stream)
        sigma_m = self.factor * np.array(self.sigma_m)
        process = gauss_markov(position.t_s, self.time_s, random) * sigma_m
        inside = in_any(position.t_s, self.windows)
        growth = np.asarray(inside[:, None, None] * np.diag(sigma_m**2), dtype=np.float64)
        moved = with_errors(position, inside[:, None] * process, growth, reported_growth=growth if self.honest else 0.0)
        return replace(recording, position=moved)


@register("disturbance", "rtk_float_overconfident")
@dataclass(frozen=True)
class RtkFloatOverconfident(RtkFloat):
    """RTK float in the given windows with the same errors as `rtk_float`, but reported as if it were fixed: R' = R.

    Both draw from the same stream, so that the same seed gives the same errors and only the covariance differs.
    Only the true covariance knows.
    """

    honest: ClassVar[bool] = False
