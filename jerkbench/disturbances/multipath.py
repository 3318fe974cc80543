"""Disturbances with position errors that last for seconds or minutes: multipath and RTK float solutions."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    OFFSET,
    DrawnFault,
    RegularWindows,
    WindowTimes,
    displaced,
    fault_stream,
    fixes_of,
    in_any,
    in_each,
    with_errors,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.simulation.sensors import gauss_markov

LASTING = Limit(lambda time: 0 < time < np.inf, "it must be above 0 s, or null.")


@dataclass(frozen=True)
class Bursts(DrawnFault):
    """Base class of disturbances with bursts of position offsets.

    A burst starts at a random time. The duration of a burst and the size of an offset are uniformly distributed between
    their limits, and the sign of an offset is random. Bursts do not overlap. The offset o (east, north, up) of a burst
    increases the true covariance of the fixes in the burst::

        R_true' = R_true + o o'

    Attributes:
        bursts: number of bursts in each run [-].
        shortest_s: minimum duration of a burst [s].
        longest_s: maximum duration of a burst [s].
        smallest_m: minimum size of an offset [m].
        largest_m: maximum size of an offset [m].
        start_s: earliest start of a burst [s].
        size_m: common size of all offsets, for parameter sweeps; if null, the sizes are random [m].
        length_s: common duration of all bursts, for parameter sweeps; if null, the durations are random [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
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
        super().__post_init__()
        self.require_range("shortest_s", "longest_s", "s", above=True)
        self.require_range("smallest_m", "largest_m", "m")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random bursts of position offsets, generated with ``seed``.

        Raises:
            RecordingError: the recording has no position fixes, or is too short for the number of bursts.
        """
        position = fixes_of(recording, "so multipath cannot be applied; remove multipath.")
        random = fault_stream(seed, self.stream_name, self.stream)
        shift = in_each(position.t_s, self._windows(random, recording)) @ self._offsets(random)
        return replace(recording, position=displaced(position, shift))

    def _windows(self, random: np.random.Generator, recording: Recording) -> FloatArray:
        """Return the start and end times (bursts, 2) of the bursts, which have random gaps between them."""
        lengths = random.uniform(self.shortest_s, self.longest_s, self.bursts)
        lengths = lengths if self.length_s is None else np.full(self.bursts, self.length_s)
        cuts = np.sort(random.uniform(size=self.bursts))
        free_s = recording.duration_s - self.start_s - lengths.sum()
        if free_s < 0:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s, so {self.bursts} bursts with a total duration of"
                f" {lengths.sum():.1f} s do not fit after {self.start_s} s; use fewer or shorter bursts."
            )
        starts = self.start_s + cuts * free_s + np.cumsum(lengths) - lengths
        return np.column_stack([starts, starts + lengths])

    def _sizes(self, random: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        """Return random sizes of offsets, multiplied by random signs [m]."""
        sizes = random.uniform(self.smallest_m, self.largest_m, shape)
        sizes = sizes if self.size_m is None else np.full(shape, self.size_m)
        return np.asarray(sizes * random.choice([-1.0, 1.0], shape))

    @abstractmethod
    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return the offset (bursts, 3) of each burst in ENU [m]."""


@register("disturbance", "multipath_single_axis")
@dataclass(frozen=True)
class MultipathSingleAxis(Bursts):
    """Adds bursts of constant position offsets on single axes, without a change of the reported covariance.

    The offset of a burst is o = s d e_i, with a random axis i (east, north or up), sign s and size d.
    """

    stream_name: ClassVar[str] = "multipath_single_axis"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        sizes = self._sizes(random, (self.bursts,))
        return np.asarray(np.eye(3)[random.integers(3, size=self.bursts)] * sizes[:, None])


@register("disturbance", "multipath_all_axes")
@dataclass(frozen=True)
class MultipathAllAxes(Bursts):
    """Adds bursts of constant position offsets on all axes, without a change of the reported covariance.

    The offset of a burst is o = (s_1 d_1, s_2 d_2, s_3 d_3) in east, north and up, with random signs and sizes. The
    comparison with `multipath_single_axis` shows the benefit of an adaptation that treats the axes separately.
    """

    stream_name: ClassVar[str] = "multipath_all_axes"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return the offset (bursts, 3) of each burst in ENU [m]."""
        return self._sizes(random, (self.bursts, 3))


# An RTK receiver may lose the fixed solution and continue with a less accurate float solution.


@register("disturbance", "rtk_float")
@dataclass(frozen=True)
class RtkFloat(RegularWindows):
    """Replaces RTK fixed by float solutions in the given windows: correlated errors with a correct covariance.

    In the windows, a stationary Gauss-Markov process b(t) is added to the fixes. The process has the standard deviation
    sigma = factor sigma_m and the correlation time T::

        z' = z + b(t),  E[b(t) b(t + tau)'] = diag(sigma^2) exp(-|tau|/T)
        R' = R + diag(sigma^2),  R_true' = R_true + diag(sigma^2)

    The reported covariance is correct for each single fix, but successive errors are correlated. A filter that models
    the errors as white is therefore overconfident. The process b(t) is generated for the complete recording, so its
    values do not depend on the windows.

    Attributes:
        sigma_m: standard deviations of b in east, north and up, before multiplication by ``factor`` [m].
        factor: factor by which ``sigma_m`` is multiplied, for parameter sweeps [-].
        time_s: T, correlation time of b [s].
        stream: label of the random stream; two RTK float disturbances need different labels to be independent.
    """

    seeded: ClassVar[bool] = True
    honest: ClassVar[bool] = True
    fault: ClassVar[str] = "float solution"

    windows_s: WindowTimes = ((30.0, 60.0), (95.0, 120.0))
    sigma_m: tuple[float, ...] = (0.25, 0.25, 0.5)
    factor: Annotated[float, NOT_NEGATIVE] = 1.0
    time_s: Annotated[float, ABOVE_ZERO] = 15.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.sigma_m) != 3 or not all(sigma >= 0 for sigma in self.sigma_m):
            raise PluginError(f"sigma_m is {self.sigma_m}; give three numbers (east, north, up) of at least 0.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random errors of float solutions, generated with ``seed``.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so rtk_float cannot be applied; remove rtk_float.")
        random = fault_stream(seed, "rtk_float", self.stream)
        sigma_m = self.factor * np.array(self.sigma_m)
        process = gauss_markov(position.t_s, self.time_s, random) * sigma_m
        inside = in_any(position.t_s, self.windows)
        growth = np.asarray(inside[:, None, None] * np.diag(sigma_m**2), dtype=np.float64)
        moved = with_errors(position, inside[:, None] * process, growth, reported_growth=growth if self.honest else 0.0)
        return replace(recording, position=moved)


@register("disturbance", "rtk_float_overconfident")
@dataclass(frozen=True)
class RtkFloatOverconfident(RtkFloat):
    """RTK float with the same errors as `rtk_float`, but with the reported covariance of a fixed solution (R' = R).

    The disturbances `rtk_float` and `rtk_float_overconfident` use the same random stream. With the same seed, the two
    disturbances have the same errors and the same true covariance, but different reported covariances.
    """

    honest: ClassVar[bool] = False
