"""What several disturbances share: draws, rows, windows, outages, added errors, scaled noise, bursts."""

import dataclasses
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar, TypeVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Position, Recording, Reference, Velocity


class Once:
    """A disturbance without phases: its seeds differ by what is drawn, or not at all."""

    def replicates(self) -> int:
        """Return 1."""
        return 1


class Phased:
    """A disturbance whose replicates are phases of one recording: seed s has the phase s mod n, unless one is fixed."""

    cycle: ClassVar[str] = "every"
    """The parameter that is n."""

    phase: int | None

    def require_phase(self) -> None:
        """Raise a PluginError unless the fixed phase is one of them."""
        count = getattr(self, self.cycle)
        if self.phase is not None and not 0 <= self.phase < count:
            raise PluginError(f"phase is {self.phase}; it must lie between 0 and {self.cycle} - 1 = {count - 1}.")

    def phase_of(self, seed: int) -> int:
        """Return the phase of a seed."""
        return int(seed % getattr(self, self.cycle)) if self.phase is None else self.phase

    def replicates(self) -> int:
        """Return how many phases there are."""
        return int(getattr(self, self.cycle)) if self.phase is None else 1


def own_stream(seed: int, disturbance: str, label: str, *parts: str) -> np.random.Generator:
    """Return the stream of a disturbance; another ``label`` gives another one, for a second of the name in a list."""
    named = (label,) if label else ()
    return stream(seed, "disturbance", disturbance, *named, *parts)


Stream = TypeVar("Stream", Position, Velocity, Heading, Reference)


def rows_of(stream: Stream, keep: BoolArray, **changes: Any) -> Stream:  # noqa: ANN401 - fields of the stream
    """Return ``stream`` with the rows where ``keep`` is True, and with the fields ``changes`` replaced."""
    values = {f.name: getattr(stream, f.name) for f in dataclasses.fields(stream)}
    arrays = {name: value[keep] for name, value in values.items() if isinstance(value, np.ndarray)}
    return dataclasses.replace(stream, **(arrays | changes))


Windows = tuple[tuple[float, ...], ...]


def require_windows(windows_s: Windows, subject: str) -> None:
    """Raise a PluginError unless each window is a begin and a later end; ``subject`` is what it should be."""
    for window in windows_s:
        if len(window) != 2 or not window[0] < window[1]:
            raise PluginError(f"The window {window} is no {subject}; give a begin and a later end, in seconds.")


def require_apart(windows_s: Windows, subject: str) -> None:
    """Raise a PluginError where two windows overlap."""
    for window, later in pairwise(sorted(windows_s)):
        if window[1] > later[0]:
            raise PluginError(f"The windows {window} and {later} overlap; give each {subject} a window of its own.")


def as_array(windows_s: Windows) -> FloatArray:
    """Return (k, 2) begins and ends."""
    return np.array(windows_s, dtype=np.float64).reshape(-1, 2)


def in_any(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return (m,) whether a time lies in any of the windows (k, 2): begin <= t < end."""
    begin, end = windows_s.T
    inside: BoolArray = ((t_s[:, None] >= begin) & (t_s[:, None] < end)).any(axis=1)
    return inside


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

    windows_s: Windows = ((40.0, 50.0), (102.0, 112.0))
    count: int = 0
    length_s: float = 10.0
    first_s: float = 60.0
    every_s: float = 40.0

    def __post_init__(self) -> None:
        """Check that each window ends after it begins, and that regular ones do not overlap."""
        if self.count < 0:
            raise PluginError(f"count is {self.count}; give 0 (windows_s as given) or more.")
        if self.count > 1 and not self.every_s >= self.length_s:
            raise PluginError(f"every_s is {self.every_s}; it must not be below length_s = {self.length_s}.")
        require_windows(self._windows(), self.fault)

    def _windows(self) -> Windows:
        if self.count == 0:
            return self.windows_s
        begins = [self.first_s + k * self.every_s for k in range(self.count)]
        return tuple((begin, begin + self.length_s) for begin in begins)


@dataclass(frozen=True)
class OutageWindows(RegularWindows):
    """When an outage is.

    A measurement that was true at t is dropped where begin <= t < end. The windows are added to the recording's
    outages, so that metrics can look inside; one that lies outside the recording is left out, one that reaches
    over its begin or end is cut there.
    """

    fault: ClassVar[str] = "outage"

    def windows_in(self, recording: Recording) -> FloatArray:
        """Return the windows (k, 2), cut to the time of the recording."""
        start_s, end_s = float(recording.clock_s[0]), recording.duration_s
        windows = np.clip(as_array(self._windows()), start_s, end_s)
        return np.asarray(windows[windows[:, 0] < windows[:, 1]])


def without(measured: Stream | None, windows_s: FloatArray) -> Stream | None:
    """Return the stream without the rows inside the windows (k, 2)."""
    if measured is None:
        return None
    return rows_of(measured, ~in_any(measured.t_s, windows_s))


Measured = TypeVar("Measured", Position, Velocity)


def values_of(measured: Position | Velocity) -> FloatArray:
    """Return what was measured (m, 3)."""
    return measured.enu_m if isinstance(measured, Position) else measured.mps


def fixes_of(recording: Recording, consequence: str) -> Position:
    """Return the fixes of a recording.

    Raises:
        RecordingError: it has none; ``consequence`` ends the sentence.
    """
    if recording.position is None:
        raise RecordingError(f"{recording.name} has no position fixes, {consequence}")
    return recording.position


def reported_covariance(measured: Position | Velocity) -> FloatArray:
    """Return the covariance as reported (m, 3, 3)."""
    return measured.covariance_m2 if isinstance(measured, Position) else measured.covariance_m2ps2


def true_covariance(measured: Position | Velocity) -> FloatArray:
    """Return the true covariance (m, 3, 3) where it is known, else the reported one."""
    true = measured.true_covariance_m2 if isinstance(measured, Position) else measured.true_covariance_m2ps2
    return reported_covariance(measured) if true is None else true


def roots_of(measured: Position | Velocity, R: FloatArray) -> FloatArray:
    """Return L (m, 3, 3), L L' = R; an axis that was not measured has an error of its own, which nobody sees."""
    present = np.isfinite(values_of(measured))
    return np.linalg.cholesky(np.where(present[:, :, None] & present[:, None, :], R, np.eye(3)))


def with_errors(
    measured: Measured, errors: FloatArray, growth: FloatArray, *, reported_growth: FloatArray | float = 0.0
) -> Measured:
    """Return the measurements with errors added.

    Args:
        measured: m rows.
        errors: (m, 3) what is added to the values.
        growth: (m, 3, 3) what is added to the true covariance.
        reported_growth: (m, 3, 3) what is added to the reported one; 0: it does not know.
    """
    true = true_covariance(measured) + growth
    reported = reported_covariance(measured) + reported_growth
    values = values_of(measured) + errors
    names = ("enu_m", "covariance_m2", "true_covariance_m2")
    if isinstance(measured, Velocity):
        names = ("mps", "covariance_m2ps2", "true_covariance_m2ps2")
    changes: dict[str, Any] = dict(zip(names, (values, reported, true), strict=True))
    return replace(measured, **changes)


def squares(errors: FloatArray) -> FloatArray:
    """Return o o' (m, 3, 3) of offsets o (m, 3)."""
    return np.asarray(errors[:, :, None] * errors[:, None, :])


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
    unit = np.einsum("mij,mj->mi", roots_of(measured, R), random.standard_normal((len(R), 3)))
    return with_errors(measured, np.sqrt(excess)[:, None] * unit, excess[:, None, None] * R)


@dataclass(frozen=True)
class Bursts(Once):
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

    seeded: ClassVar[bool] = True
    stream_name: ClassVar[str]

    bursts: int = 10
    shortest_s: float = 2.0
    longest_s: float = 6.0
    smallest_m: float = 0.5
    largest_m: float = 2.0
    start_s: float = 10.0
    size_m: float | None = None
    length_s: float | None = None
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.bursts < 0:
            raise PluginError(f"bursts is {self.bursts}; give 0 or more.")
        if not 0 < self.shortest_s <= self.longest_s:
            raise PluginError(
                f"A burst of {self.shortest_s} to {self.longest_s} s is none; give 0 < shortest <= longest."
            )
        if not 0 <= self.smallest_m <= self.largest_m:
            raise PluginError(f"{self.smallest_m} to {self.largest_m} m is no range; give 0 <= smallest <= largest.")

        if self.size_m is not None and not 0 <= self.size_m < np.inf:
            raise PluginError(f"size_m is {self.size_m}; give 0 m or more, or null.")
        if self.length_s is not None and not 0 < self.length_s < np.inf:
            raise PluginError(f"length_s is {self.length_s}; a burst must be longer than 0 s, or null.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the bursts of ``seed``.

        Raises:
            RecordingError: it has no position, or is too short for so many bursts.
        """
        position = fixes_of(recording, "so there is nothing for multipath to move.")
        random = own_stream(seed, self.stream_name, self.stream)
        begin, end = self._windows(random, recording).T
        shift = ((position.t_s[:, None] >= begin) & (position.t_s[:, None] < end)) @ self._offsets(random)
        return replace(recording, position=with_errors(position, shift, squares(shift)))

    def _windows(self, random: np.random.Generator, recording: Recording) -> FloatArray:
        """Return (bursts, 2): the time that is left over is cut at random points into the gaps between the bursts."""
        lengths = random.uniform(self.shortest_s, self.longest_s, self.bursts)
        if self.length_s is not None:
            lengths = np.full(self.bursts, self.length_s)
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
        if self.size_m is not None:
            sizes = np.full(shape, self.size_m)
        return np.asarray(sizes * random.choice([-1.0, 1.0], shape))

    @abstractmethod
    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU."""
