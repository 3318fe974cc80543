"""Windows of outages, and streams without the rows inside."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances._regular_windows import RegularWindows
from jerkbench.disturbances._rows import Stream, rows_of
from jerkbench.disturbances._windows import as_array, in_any
from jerkbench.recording import Recording


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

    def replicates(self) -> int:
        """Return 1."""
        return 1


def without(measured: Stream | None, windows_s: FloatArray) -> Stream | None:
    """Return the stream without the rows inside the windows (k, 2)."""
    if measured is None:
        return None
    return rows_of(measured, ~in_any(measured.t_s, windows_s))
