"""The contract of an attitude filter."""

from collections.abc import Hashable
from typing import Protocol

from jerkbench.estimate import Attitude
from jerkbench.recording import Recording


class AttitudeFilter(Hashable, Protocol):
    """A way to find the attitude; optional: `Requiring`, `Remarking`."""

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the gravity-compensated acceleration at the IMU's stamps."""
        ...
