"""Windows of a fault: as given, or regular ones of a given length."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.disturbances._windows import Windows, require_windows
from jerkbench.errors import PluginError


@dataclass(frozen=True)
class RegularWindows:
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
