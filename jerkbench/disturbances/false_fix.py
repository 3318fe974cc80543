"""RTK that settles on the wrong integers: fixes that are off by a constant for a while, and claim to be fixed."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    RegularWindows,
    Windows,
    as_array,
    fixes_of,
    own_stream,
    require_apart,
    squares,
    with_errors,
)
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "false_fix")
@dataclass(frozen=True)
class FalseFix(RegularWindows):
    """False fixes in the given windows: off by a constant of a given size, with the covariance of a right one.

    Each window has an offset o of length d in a random direction of space::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    Attributes:
        offset_m: d, length of o; swept, it tells from which size on a fault is noticed.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True
    fault: ClassVar[str] = "false fix"

    windows_s: Windows = ((30.0, 40.0), (70.0, 80.0), (110.0, 120.0))
    offset_m: float = 1.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check windows and offset."""
        super().__post_init__()
        require_apart(self._windows(), "false fix")
        if not 0 <= self.offset_m < np.inf:
            raise PluginError(f"offset_m is {self.offset_m}; a length must be 0 m or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the false fixes of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be false; leave false_fix out.")
        windows = as_array(self._windows())
        begin, end = windows.T
        inside = (position.t_s[:, None] >= begin) & (position.t_s[:, None] < end)
        shift = inside @ self._offsets(len(windows), seed)
        return replace(recording, position=with_errors(position, shift, squares(shift)))

    def _offsets(self, windows: int, seed: int) -> FloatArray:
        """Return (windows, 3) ENU."""
        direction = own_stream(seed, "false_fix", self.stream).standard_normal((windows, 3))
        return np.asarray(self.offset_m * direction / np.linalg.norm(direction, axis=1, keepdims=True))
