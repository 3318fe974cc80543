"""No disturbance."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.disturbances.common import Once
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "none")
@dataclass(frozen=True)
class NoDisturbance(Once):
    """The recording as it is.

    The row that every disturbance is compared with.
    """

    seeded: ClassVar[bool] = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return ``recording`` itself."""
        return recording
