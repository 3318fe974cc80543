"""Single fixes that are grossly off."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import Once, fixes_of, own_stream, squares, with_errors
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "outliers")
@dataclass(frozen=True)
class Outliers(Once):
    """Single position fixes that are off by metres; the reported covariance does not change.

    Each fix, with the given probability and independent of the others, is moved by o = d u: d ~ U(smallest, largest),
    u a random direction in space. Of those R_true' = R_true + o o'. A test that drops a fix (chi2) should see them; a
    window over several fixes hardly helps.

    Attributes:
        probability: that a fix is an outlier, from 0 to 1.
        smallest_m: length of o.
        largest_m: length of o.
        size_m: length of every o, to be swept; null: ``smallest_m`` to ``largest_m``.
        start_s: no outlier before (the first fix is where a filter starts).
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    probability: float = 0.02
    smallest_m: float = 5.0
    largest_m: float = 20.0
    size_m: float | None = None
    start_s: float = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 <= self.probability <= 1:
            raise PluginError(f"probability is {self.probability}; it must be from 0 to 1.")
        if not 0 <= self.smallest_m <= self.largest_m < np.inf:
            raise PluginError(f"{self.smallest_m} to {self.largest_m} m is no range; give 0 <= smallest <= largest.")

        if self.size_m is not None and not 0 <= self.size_m < np.inf:
            raise PluginError(f"size_m is {self.size_m}; give 0 m or more, or null.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the outliers of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be an outlier; leave it out.")
        shift = self._offsets(len(position.t_s), seed)
        shift[position.t_s < self.start_s] = 0.0
        return replace(recording, position=with_errors(position, shift, squares(shift)))

    def _offsets(self, m: int, seed: int) -> FloatArray:
        """Return (m, 3) ENU, zero where a fix is none."""
        random = own_stream(seed, "outliers", self.stream)
        hit = random.uniform(size=m) < self.probability
        direction = random.standard_normal((m, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        sizes = random.uniform(self.smallest_m, self.largest_m, m)
        if self.size_m is not None:
            sizes = np.full(m, self.size_m)
        return np.asarray((sizes * hit)[:, None] * direction)
