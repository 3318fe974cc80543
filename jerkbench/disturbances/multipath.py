"""Fixes that are off for some seconds or a minute: multipath, on one axis or on all, and RTK that is float."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    CORRELATION_TIME,
    OFFSET,
    DrawnFault,
    RegularWindows,
    WindowTimes,
    displaced,
    fixes_of,
    in_any,
    in_each,
    own_stream,
    with_errors,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.simulation.imu import gauss_markov

LASTING = Limit(lambda time: 0 < time < np.inf, "a burst must be longer than 0 s, or null.")


@dataclass(frozen=True)
class Bursts(DrawnFault):
    """When the bursts are, and how large.

    A burst begins at random and lasts T ~ U(shortest, longest); an offset is d ~ U(smallest, largest) with a random
    sign. Bursts do not overlap. With o the offset (east, north, up) of a burst, the true covariance of its fixes is::

        R_true = R + o o'

    Attributes:
        bursts: how many in a run.
        shortest_s: of a burst.
        longest_s: of a burst.
        smallest_m: offset.
        largest_m: offset.
        start_s: no burst before.
        size_m: of every offset, to be swept; null: ``smallest_m`` to ``largest_m``.
        length_s: of every burst, to be swept; null: ``shortest_s`` to ``longest_s``.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    stream_name: ClassVar[str]

    bursts: Annotated[int, Limit(lambda count: count >= 0, "give 0 or more.")] = 10
    shortest_s: float = 2.0
    longest_s: float = 6.0
    smallest_m: float = 0.5
    largest_m: float = 2.0
    start_s: float = 10.0
    size_m: Annotated[float | None, OFFSET] = None
    length_s: Annotated[float | None, LASTING] = None
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if not 0 < self.shortest_s <= self.longest_s:
            burst = f"A burst of {self.shortest_s} to {self.longest_s} s"
            raise PluginError(f"{burst} is none; give 0 < shortest <= longest.")
        self.require_range("smallest_m", "largest_m", "m")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the bursts of ``seed``.

        Raises:
            RecordingError: it has no position, or is too short for so many bursts.
        """
        position = fixes_of(recording, "so there is nothing for multipath to move.")
        random = own_stream(seed, self.stream_name, self.stream)
        shift = in_each(position.t_s, self._windows(random, recording)) @ self._offsets(random)
        return replace(recording, position=displaced(position, shift))

    def _windows(self, random: np.random.Generator, recording: Recording) -> FloatArray:
        """Return (bursts, 2): the time that is left over is cut at random points into the gaps between the bursts."""
        lengths = random.uniform(self.shortest_s, self.longest_s, self.bursts)
        lengths = lengths if self.length_s is None else np.full(self.bursts, self.length_s)
        cuts = np.sort(random.uniform(size=self.bursts))
        left_s = recording.duration_s - self.start_s - lengths.sum()
        if left_s < 0:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s; {self.bursts} bursts of {lengths.sum():.1f} s"
                f" together do not fit after {self.start_s} s: ask for fewer or shorter ones."
            )
        begins = self.start_s + cuts * left_s + np.cumsum(lengths) - lengths
        return np.column_stack([begins, begins + lengths])

    def _sizes(self, random: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        """Return offsets with their signs."""
        sizes = random.uniform(self.smallest_m, self.largest_m, shape)
        sizes = sizes if self.size_m is None else np.full(shape, self.size_m)
        return np.asarray(sizes * random.choice([-1.0, 1.0], shape))

    @abstractmethod
    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU."""


@register("disturbance", "multipath_single_axis")
@dataclass(frozen=True)
class MultipathSingleAxis(Bursts):
    """Bursts in which the position is off by a constant on one axis; the reported covariance does not change.

    The offset of a burst is o = s d e_i, with the axis i of east, north, up, the sign s and the size d at random.
    """

    stream_name: ClassVar[str] = "multipath_single_axis"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU, one axis each."""
        sizes = self._sizes(random, (self.bursts,))
        return np.asarray(np.eye(3)[random.integers(3, size=self.bursts)] * sizes[:, None])


@register("disturbance", "multipath_all_axes")
@dataclass(frozen=True)
class MultipathAllAxes(Bursts):
    """Bursts in which the position is off by a constant on each axis; the reported covariance does not change.

    The offset of a burst is o = (s_1 d_1, s_2 d_2, s_3 d_3), east, north, up, each sign and each size at random.
    All axes are bad at once: the comparison with `multipath_single_axis` shows what an adaptation gains by treating
    each axis by itself.
    """

    stream_name: ClassVar[str] = "multipath_all_axes"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU."""
        return self._sizes(random, (self.bursts, 3))


# RTK that loses its fixed solution and falls back to a float one.


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
    factor: Annotated[float, Limit(lambda k: 0 <= k < np.inf, "give 0 or more.")] = 1.0
    time_s: Annotated[float, CORRELATION_TIME] = 15.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check windows, sigmas and the time."""
        super().__post_init__()
        if len(self.sigma_m) != 3 or not all(sigma >= 0 for sigma in self.sigma_m):
            raise PluginError(f"sigma_m is {self.sigma_m}; give three, 0 or more: east, north, up.")

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
