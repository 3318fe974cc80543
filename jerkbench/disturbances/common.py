"""Base classes and functions of the disturbances, and the disturbance `none`."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import Limit, Limited
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Position, Recording, Reference, Velocity

FROM_0_TO_1 = Limit(lambda p: 0 <= p <= 1, "it must be from 0 to 1.")
OFFSET = Limit(lambda size: 0 <= size < np.inf, "give 0 m or more, or null.")


class Unphased(Limited):
    """Base class of disturbances without phases. The seed determines only the random numbers of the disturbance."""

    seeded: ClassVar[bool] = False

    def replicates(self) -> int:
        """Return 1, because the disturbance has only one phase."""
        return 1

    def require_range(self, low: str, high: str, unit: str, *, above: bool = False) -> None:
        """Check that the values of the parameters named ``low`` and ``high`` are finite and satisfy 0 <= low <= high.

        If ``above`` is true, the value of the parameter ``low`` must be above 0.

        Raises:
            PluginError: the values of the parameters ``low`` and ``high`` are not a valid range.
        """
        minimum, maximum = getattr(self, low), getattr(self, high)
        if not (0 <= minimum <= maximum < np.inf and (minimum or not above)):
            raise PluginError(
                f"Invalid range {minimum} to {maximum} {unit}; {low} and {high} must satisfy"
                f" 0 {'<' if above else '<='} {low} <= {high}."
            )


class DrawnFault(Unphased):
    """Base class of random disturbances, which are different for each seed."""

    seeded: ClassVar[bool] = True


class Phased(Limited):
    """Base class of disturbances with n variants (phases). If ``phase`` is None, seed s uses the phase s mod n."""

    seeded: ClassVar[bool] = False
    cycle: ClassVar[str] = "every"
    """Name of the parameter that contains n."""

    phase: int | None

    def __post_init__(self) -> None:
        super().__post_init__()
        count = getattr(self, self.cycle)
        if self.phase is not None and not 0 <= self.phase < count:
            raise PluginError(f"phase is {self.phase}; it must lie between 0 and {self.cycle} - 1 = {count - 1}.")

    def phase_of(self, seed: int) -> int:
        """Return the phase that the disturbance uses for a seed."""
        return int(seed % getattr(self, self.cycle)) if self.phase is None else self.phase

    def replicates(self) -> int:
        """Return the number of different phases, which is 1 if ``phase`` is set."""
        return int(getattr(self, self.cycle)) if self.phase is None else 1


@register("disturbance", "none")
@dataclass(frozen=True)
class NoDisturbance(Unphased):
    """Does not change the recording.

    The unchanged recording is the nominal case for comparisons with other disturbances.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return ``recording`` without a change."""
        return recording


def fault_stream(seed: int, disturbance: str, label: str, *parts: str) -> np.random.Generator:
    """Return the random number generator of a disturbance. Different values of ``label`` give independent numbers."""
    named = (label,) if label else ()
    return stream(seed, "disturbance", disturbance, *named, *parts)


AnyStream = TypeVar("AnyStream", Position, Velocity, Heading, Reference)


def rows_of(stream: AnyStream, selected: BoolArray | IntArray, **changes: Any) -> AnyStream:  # noqa: ANN401 - fields of the stream
    """Return the rows ``selected`` (a mask or indices) of ``stream``. ``changes`` are new values of complete fields."""
    values = {f.name: getattr(stream, f.name) for f in fields(stream)}
    arrays = {name: value[selected] for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(stream, **(arrays | changes))


WindowTimes = tuple[tuple[float, ...], ...]


def in_each(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return a mask (m, k) that is true where one of the m times lies in one of the k windows, start <= t < end."""
    start, end = windows_s.T
    return np.asarray((t_s[:, None] >= start) & (t_s[:, None] < end))


def in_any(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return a mask (m,) that is true where one of the m times lies in any of the windows (k, 2)."""
    return np.asarray(in_each(t_s, windows_s).any(axis=1))


def without(measured: AnyStream | None, windows_s: FloatArray) -> AnyStream | None:
    """Return the measurements outside the windows (k, 2), or None if ``measured`` is None."""
    return None if measured is None else rows_of(measured, ~in_any(measured.t_s, windows_s))


@dataclass(frozen=True)
class RegularWindows(Unphased):
    """Base class of disturbances that act in time windows.

    The disturbance affects the times start <= t < end of each window. If ``count`` is above 0, the disturbance uses
    regular windows with the numbers k = 0 ... count - 1::

        [first_s + k every_s, first_s + k every_s + length_s)

    Attributes:
        windows_s: start and end time of each window [s].
        count: number of regular windows that are used instead of ``windows_s``, or 0 to use ``windows_s`` [-].
        length_s: length of each regular window [s].
        first_s: start of the first regular window [s].
        every_s: time between the starts of two regular windows [s].
    """

    fault: ClassVar[str] = "fault"
    """Name of the fault in error messages."""

    windows_s: WindowTimes = ((40.0, 50.0), (102.0, 112.0))
    count: Annotated[int, Limit(lambda count: count >= 0, "give 0 (windows_s as given) or more.")] = 0
    length_s: float = 10.0
    first_s: float = 60.0
    every_s: float = 40.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.count > 1 and not self.every_s >= self.length_s:
            raise PluginError(f"every_s is {self.every_s}; it must not be below length_s = {self.length_s}.")
        for window in (window for window in self._windows() if len(window) != 2 or not window[0] < window[1]):
            raise PluginError(f"Invalid window {window} of a {self.fault}; give a start and a later end, in seconds.")

    def _windows(self) -> WindowTimes:
        if self.count == 0:
            return self.windows_s
        starts = [self.first_s + k * self.every_s for k in range(self.count)]
        return tuple((start, start + self.length_s) for start in starts)

    @property
    def windows(self) -> FloatArray:
        """Start and end times (k, 2) of the windows [s]."""
        return np.array(self._windows(), dtype=np.float64).reshape(-1, 2)


FixesOrVelocity = TypeVar("FixesOrVelocity", Position, Velocity)


def fixes_of(recording: Recording, consequence: str) -> Position:
    """Return the position fixes of a recording.

    Raises:
        RecordingError: the recording has no position fixes; the error message ends with ``consequence``.
    """
    if recording.position is None:
        raise RecordingError(f"{recording.name} has no position fixes, {consequence}")
    return recording.position


def velocity_of(recording: Recording, name: str) -> Velocity:
    """Return the velocities of a recording.

    Raises:
        RecordingError: the recording has no velocities; the message contains the name ``name`` of the disturbance.
    """
    if recording.velocity is None:
        raise RecordingError(f"{recording.name} has no velocity, so {name} cannot be applied; remove {name}.")
    return recording.velocity


def in_space(random: np.random.Generator, rows: int, length_m: float = 1.0) -> FloatArray:
    """Return vectors (rows, 3) of the length ``length_m`` with random directions in space."""
    direction = random.standard_normal((rows, 3))
    return np.asarray(length_m * direction / np.linalg.norm(direction, axis=1, keepdims=True))


def in_plane(random: np.random.Generator, rows: int) -> FloatArray:
    """Return horizontal unit vectors (rows, 3) with random directions."""
    angle = random.uniform(0, 2 * np.pi, rows)
    return np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def with_errors(
    measured: FixesOrVelocity, errors: FloatArray, growth: FloatArray, *, reported_growth: FloatArray | float = 0.0
) -> FixesOrVelocity:
    """Return the measurements with added errors and increased covariances.

    Args:
        measured: position fixes or velocities with m rows.
        errors: (m, 3) errors that are added to the measured values.
        growth: (m, 3, 3) increase of the true covariance.
        reported_growth: (m, 3, 3) increase of the reported covariance; 0 if the errors are not reported.
    """
    return measured.changed(measured.values + errors, measured.reported + reported_growth, measured.true + growth)


def displaced(measured: FixesOrVelocity, offsets: FloatArray) -> FixesOrVelocity:
    """Return the measurements with added offsets o (m, 3). Only the true covariance is increased, by o o'."""
    return with_errors(measured, offsets, offsets[:, :, None] * offsets[:, None, :])
