"""The sanitiser's report: each fault, its stream, its number, and what became of the rows."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.errors import PluginError, RecordingError, unknown

MODES = ("drop", "refuse", "repair")
DROPPED = "dropped"
KEPT = "kept"


@dataclass(frozen=True)
class Finding:
    """One kind of trouble in one stream.

    Attributes:
        stream: its name.
        fault: what is wrong with the rows, after "rows with".
        count: how many rows.
        of: of how many.
        done: what became of them.
        first_s: time of the first of them since the first message of the bag, by the recording computer's clock.
    """

    stream: str
    fault: str
    count: int
    of: int
    done: str
    first_s: float

    def __str__(self) -> str:
        """Return the finding as a sentence."""
        return (
            f"{self.stream}: {self.count} of {self.of} rows with {self.fault}"
            f", the first {self.first_s:.2f} s into the bag: {self.done}."
        )


class Ledger:
    """Collects findings; in the mode "refuse" the first one is an error."""

    def __init__(self, mode: str, start_ns: int) -> None:
        """Begin an empty report.

        Args:
            mode: one of `MODES`.
            start_ns: when the bag begins, by the recording computer's clock.

        Raises:
            PluginError: no such mode.
        """
        if mode not in MODES:
            raise PluginError(unknown("sanitise mode", mode, MODES))
        self.mode, self.start_ns = mode, start_ns
        self.findings: list[Finding] = []

    @property
    def repairs(self) -> bool:
        """Whether what can be mended is to be mended."""
        return self.mode == "repair"

    def add(self, stream: str, fault: str, rows: BoolArray, bag_ns: IntArray, done: str) -> None:
        """Note that ``rows`` (n,), recorded at ``bag_ns`` (n,), have the ``fault``, if any has.

        Raises:
            RecordingError: any has, and the mode is "refuse".
        """
        count = int(np.count_nonzero(rows))
        if not count:
            return
        first_s = (int(bag_ns[int(np.argmax(rows))]) - self.start_ns) * 1e-9
        finding = Finding(stream, fault, count, len(rows), done, first_s)
        if self.mode == "refuse":
            raise RecordingError(
                f"{stream}: {count} of {len(rows)} rows with {fault}, the first {first_s:.2f} s into the bag;"
                " choose sanitise=repair or sanitise=drop to go on without them."
            )
        self.findings.append(finding)
