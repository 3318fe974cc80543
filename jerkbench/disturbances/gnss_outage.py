"""Intervals without GNSS."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.disturbances._rows import Stream, rows_of
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage:
    """No position and no velocity in the given windows; the reference stays.

    A measurement that was true at t is dropped where begin <= t < end. The windows are added to the recording's
    outages, so that metrics can look inside; one that lies outside the recording is left out, one that reaches
    over its begin or end is cut there.

    With ``count`` above 0 the windows are, for k = 0 ... count - 1::

        [first_s + k every_s, first_s + k every_s + length_s)

    Attributes:
        windows_s: begin and end of each.
        count: how many regular windows to use in place of ``windows_s``; 0: those as given.
        length_s: of each regular window.
        first_s: begin of the first.
        every_s: from one begin to the next.
        heading: whether the dual-antenna heading goes too (it comes from the same antennas, but the paper's outage
            concerns position and velocity).
    """

    seeded: ClassVar[bool] = False

    windows_s: tuple[tuple[float, ...], ...] = ((40.0, 50.0), (102.0, 112.0))
    count: int = 0
    length_s: float = 10.0
    first_s: float = 60.0
    every_s: float = 40.0
    heading: bool = False

    def __post_init__(self) -> None:
        """Check that each window ends after it begins, and that regular ones do not overlap."""
        if self.count < 0:
            raise PluginError(f"count is {self.count}; give 0 (windows_s as given) or more.")
        if self.count > 1 and not self.every_s >= self.length_s:
            raise PluginError(f"every_s is {self.every_s}; it must not be below length_s = {self.length_s}.")
        for window in self._windows():
            if len(window) != 2 or not window[0] < window[1]:
                raise PluginError(f"The window {window} is no outage; give a begin and a later end, in seconds.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS in the windows."""
        windows = self._inside(float(recording.imu.t_s[0]), recording.duration_s)
        return replace(
            recording,
            position=_without(recording.position, windows),
            velocity=_without(recording.velocity, windows),
            heading=_without(recording.heading, windows) if self.heading else recording.heading,
            outages_s=np.concatenate([recording.outages_s, windows]),
        )

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def _windows(self) -> tuple[tuple[float, ...], ...]:
        if self.count == 0:
            return self.windows_s
        begins = [self.first_s + k * self.every_s for k in range(self.count)]
        return tuple((begin, begin + self.length_s) for begin in begins)

    def _inside(self, start_s: float, end_s: float) -> FloatArray:
        windows = np.clip(np.array(self._windows(), dtype=np.float64).reshape(-1, 2), start_s, end_s)
        return np.asarray(windows[windows[:, 0] < windows[:, 1]])


def _without(measured: Stream | None, windows_s: FloatArray) -> Stream | None:
    if measured is None:
        return None
    return rows_of(measured, ~_in_any(measured.t_s, windows_s))


def _in_any(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    begin, end = windows_s.T
    inside: BoolArray = ((t_s[:, None] >= begin) & (t_s[:, None] < end)).any(axis=1)
    return inside
