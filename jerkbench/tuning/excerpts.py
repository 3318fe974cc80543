"""A part of a recording: its first share, or all of it with errors that count afterwards."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.recording import Recording

LEAST = 2
"""Rows of a stream without which nothing can be estimated."""


@dataclass(frozen=True)
class Excerpt:
    """The part of a recording before or after a time.

    Attributes:
        share: of the duration, at which the two parts meet [-].
        late: whether errors count from there on, over the whole recording; else the recording ends there.
    """

    seeded: ClassVar[bool] = False

    share: float
    late: bool

    def apply(self, recording: Recording, seed: int) -> Recording:  # noqa: ARG002 - the contract of a disturbance
        """Return the part.

        Raises:
            RecordingError: too little of it is left.
        """
        at_s = self.share * recording.duration_s
        return scored_from(recording, at_s) if self.late else ended_at(recording, at_s)

    def replicates(self) -> int:
        """Return 1."""
        return 1


def scored_from(recording: Recording, begin_s: float) -> Recording:
    """Return the recording with errors that count from ``begin_s`` on."""
    reference = recording.reference
    return replace(recording, reference=replace(reference, scored=reference.scored & (reference.t_s >= begin_s)))


def ended_at(recording: Recording, end_s: float) -> Recording:
    """Return the recording without anything after ``end_s``.

    Raises:
        RecordingError: a stream has fewer than two rows left.
    """
    streams: dict[str, Any] = {}
    for name in ("imu", "position", "velocity", "heading", "reference"):
        stream = getattr(recording, name)
        if stream is not None:
            streams[name] = _first_rows(stream, int(np.searchsorted(stream.t_s, end_s, side="right")), recording.name)
    outages_s = recording.outages_s[recording.outages_s[:, 0] < end_s]
    return replace(recording, **streams, outages_s=np.minimum(outages_s, end_s))


def _first_rows(stream: Any, count: int, name: str) -> Any:  # noqa: ANN401 - any stream, by its fields
    if count < LEAST:
        raise RecordingError(
            f"{name} has {count} rows of {type(stream).__name__} before the end of the part to tune on; take a larger"
            " share of the time."
        )
    rows = len(stream.t_s)
    whole = {key: value for key, value in vars(stream).items() if isinstance(value, np.ndarray)}
    return replace(stream, **{key: value[:count] for key, value in whole.items() if len(value) == rows})
