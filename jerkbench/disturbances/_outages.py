"""What all outages share: their windows, and streams without the rows inside."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances._rows import Stream, rows_of
from jerkbench.disturbances._windows import Windows, as_array, in_any, require_windows
from jerkbench.errors import PluginError
from jerkbench.recording import Recording


@dataclass(frozen=True)
class OutageWindows:
    """When an outage is.

    A measurement that was true at t is dropped where begin <= t < end. The windows are added to the recording's
    outages, so that metrics can look inside; one that lies outside the recording is left out, one that reaches
    over its begin or end is cut there.

    With ``count`` above 0 the windows are, for k = 0 ... count - 1::

        [first_s + k every_s, first_s + k every_s + length_s)

    Attributes:
        windows_s: begin and end of each [s].
        count: how many regular windows to use in place of ``windows_s``; 0: those as given.
        length_s: of each regular window.
        first_s: begin of the first.
        every_s: from one begin to the next.
    """

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
        require_windows(self._windows(), "outage")

    def windows_in(self, recording: Recording) -> FloatArray:
        """Return the windows (k, 2), cut to the time of the recording."""
        start_s, end_s = float(recording.clock_s[0]), recording.duration_s
        windows = np.clip(as_array(self._windows()), start_s, end_s)
        return np.asarray(windows[windows[:, 0] < windows[:, 1]])

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def _windows(self) -> Windows:
        if self.count == 0:
            return self.windows_s
        begins = [self.first_s + k * self.every_s for k in range(self.count)]
        return tuple((begin, begin + self.length_s) for begin in begins)


def without(measured: Stream | None, windows_s: FloatArray) -> Stream | None:
    """Return the stream without the rows inside the windows (k, 2)."""
    if measured is None:
        return None
    return rows_of(measured, ~in_any(measured.t_s, windows_s))
