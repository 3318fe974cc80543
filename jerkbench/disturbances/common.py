"""What several disturbances share: checks, draws, rows, windows, added errors; and `none`."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import Limit, Limited
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Position, Recording, Reference, Velocity

FROM_0_TO_1 = Limit(lambda p: 0 <= p <= 1, "it must be from 0 to 1.")
OFFSET = Limit(lambda size: 0 <= size < np.inf, "give 0 m or more, or null.")
DEVIATION = Limit(lambda sigma: 0 <= sigma < np.inf, "a standard deviation must be 0 or more.")
CORRELATION_TIME = Limit(lambda time: 0 < time < np.inf, "a correlation time must be positive.")


class Once(Limited):
    """A disturbance without phases: its seeds differ by what is drawn, or not at all."""

    seeded: ClassVar[bool] = False

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def require_range(self, low: str, high: str, unit: str, *, above: bool = False) -> None:
        """Raise a PluginError unless 0 <= ``low`` <= ``high``, and finite; ``above``: above 0."""
        least, most = getattr(self, low), getattr(self, high)
        if not (0 <= least <= most < np.inf and (least or not above)):
            rule = f"give 0 {'<' if above else '<='} {low.partition('_')[0]} <= {high.partition('_')[0]}."
            raise PluginError(f"{least} to {most} {unit} is no range; {rule}")


class DrawnFault(Once):
    """A disturbance that draws: each seed is another one."""

    seeded: ClassVar[bool] = True


class Phased(Limited):
    """A disturbance whose replicates are phases of one recording: seed s has the phase s mod n, unless one is fixed."""

    seeded: ClassVar[bool] = False
    cycle: ClassVar[str] = "every"
    """The parameter that is n."""

    phase: int | None

    def __post_init__(self) -> None:
        """Check that the fixed phase is one of them."""
        super().__post_init__()
        count = getattr(self, self.cycle)
        if self.phase is not None and not 0 <= self.phase < count:
            raise PluginError(f"phase is {self.phase}; it must lie between 0 and {self.cycle} - 1 = {count - 1}.")

    def phase_of(self, seed: int) -> int:
        """Return the phase of a seed."""
        return int(seed % getattr(self, self.cycle)) if self.phase is None else self.phase

    def replicates(self) -> int:
        """Return how many phases there are."""
        return int(getattr(self, self.cycle)) if self.phase is None else 1


@register("disturbance", "none")
@dataclass(frozen=True)
class NoDisturbance(Once):
    """The recording as it is.

    The row that every disturbance is compared with.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return ``recording`` itself."""
        return recording


def own_stream(seed: int, disturbance: str, label: str, *parts: str) -> np.random.Generator:
    """Return the stream of a disturbance; another ``label`` gives another one, for a second of the name in a list."""
    named = (label,) if label else ()
    return stream(seed, "disturbance", disturbance, *named, *parts)


AnyStream = TypeVar("AnyStream", Position, Velocity, Heading, Reference)


def rows_of(stream: AnyStream, keep: BoolArray, **changes: Any) -> AnyStream:  # noqa: ANN401 - fields of the stream
    """Return ``stream`` with the rows where ``keep`` is True, and with the fields ``changes`` replaced."""
    values = {f.name: getattr(stream, f.name) for f in fields(stream)}
    arrays = {name: value[keep] for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(stream, **(arrays | changes))


WindowTimes = tuple[tuple[float, ...], ...]


def in_each(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return (m, k) whether a time lies in each of the windows (k, 2): begin <= t < end."""
    begin, end = windows_s.T
    return np.asarray((t_s[:, None] >= begin) & (t_s[:, None] < end))


def in_any(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return (m,) whether a time lies in any of the windows (k, 2)."""
    return np.asarray(in_each(t_s, windows_s).any(axis=1))


def without(measured: AnyStream | None, windows_s: FloatArray) -> AnyStream | None:
    """Return the stream without the rows inside the windows (k, 2)."""
    return None if measured is None else rows_of(measured, ~in_any(measured.t_s, windows_s))


@dataclass(frozen=True)
class RegularWindows(Once):
    """When a fault is, and for how long.

    It acts where begin <= t < end. With ``count`` above 0 the windows are, for k = 0 ... count - 1::

        [first_s + k every_s, first_s + k every_s + length_s)

    Attributes:
        windows_s: begin and end of each [s].
        count: how many regular windows to use in place of ``windows_s``; 0: those as given.
        length_s: of each regular window.
        first_s: begin of the first.
        every_s: from one begin to the next.
    """

    fault: ClassVar[str] = "fault"
    """What the windows are windows of."""

    windows_s: WindowTimes = ((40.0, 50.0), (102.0, 112.0))
    count: Annotated[int, Limit(lambda count: count >= 0, "give 0 (windows_s as given) or more.")] = 0
    length_s: float = 10.0
    first_s: float = 60.0
    every_s: float = 40.0

    def __post_init__(self) -> None:
        """Check that each window ends after it begins, and that regular ones do not overlap."""
        super().__post_init__()
        if self.count > 1 and not self.every_s >= self.length_s:
            raise PluginError(f"every_s is {self.every_s}; it must not be below length_s = {self.length_s}.")
        for window in (window for window in self._windows() if len(window) != 2 or not window[0] < window[1]):
            raise PluginError(f"The window {window} is no {self.fault}; give a begin and a later end, in seconds.")

    def _windows(self) -> WindowTimes:
        if self.count == 0:
            return self.windows_s
        begins = [self.first_s + k * self.every_s for k in range(self.count)]
        return tuple((begin, begin + self.length_s) for begin in begins)

    @property
    def windows(self) -> FloatArray:
        """(k, 2) begins and ends."""
        return np.array(self._windows(), dtype=np.float64).reshape(-1, 2)


FixesOrVelocity = TypeVar("FixesOrVelocity", Position, Velocity)


def fixes_of(recording: Recording, consequence: str) -> Position:
    """Return the fixes of a recording.

    Raises:
        RecordingError: it has none; ``consequence`` ends the sentence.
    """
    if recording.position is None:
        raise RecordingError(f"{recording.name} has no position fixes, {consequence}")
    return recording.position


def in_space(random: np.random.Generator, rows: int, length_m: float = 1.0) -> FloatArray:
    """Return vectors (rows, 3) of one length in random directions."""
    direction = random.standard_normal((rows, 3))
    return np.asarray(length_m * direction / np.linalg.norm(direction, axis=1, keepdims=True))


def in_plane(random: np.random.Generator, rows: int) -> FloatArray:
    """Return horizontal vectors (rows, 3) of length 1 in random directions."""
    angle = random.uniform(0, 2 * np.pi, rows)
    return np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def with_errors(
    measured: FixesOrVelocity, errors: FloatArray, growth: FloatArray, *, reported_growth: FloatArray | float = 0.0
) -> FixesOrVelocity:
    """Return the measurements with errors added.

    Args:
        measured: m rows.
        errors: (m, 3) what is added to the values.
        growth: (m, 3, 3) what is added to the true covariance.
        reported_growth: (m, 3, 3) what is added to the reported one; 0: it does not know.
    """
    return measured.changed(measured.values + errors, measured.reported + reported_growth, measured.true + growth)


def displaced(measured: FixesOrVelocity, offsets: FloatArray) -> FixesOrVelocity:
    """Return the measurements with offsets o (m, 3) added that nobody reports: their true covariance grows by o o'."""
    return with_errors(measured, offsets, offsets[:, :, None] * offsets[:, None, :])
