"""IMU samples that are missing."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.disturbances.common import Once, own_stream
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Imu, Recording


@register("disturbance", "dropout")
@dataclass(frozen=True)
class Dropout(Once):
    """IMU samples are missing, one or a few in a row.

    From each sample on, with the given probability, N ~ U{1 ... longest} samples are missing. The first and the last
    sample are always there. The next sample that is there then stands for the whole gap: its interval begins at the
    last one before the gap.

    Attributes:
        probability: that a gap begins at a sample, from 0 to 1.
        longest: most samples that one gap takes.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    probability: float = 0.01
    longest: int = 5
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 <= self.probability <= 1:
            raise PluginError(f"probability is {self.probability}; it must be from 0 to 1.")
        if self.longest < 1:
            raise PluginError(f"longest is {self.longest}; a gap takes 1 sample or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without the samples that ``seed`` drops."""
        imu = recording.inertial
        keep = ~self._missing(len(imu.t_s), seed)
        keep[[0, -1]] = True
        return replace(recording, imu=Imu(imu.t_s[keep], imu.accel_mps2[keep], imu.gyro_radps[keep]))

    def _missing(self, n: int, seed: int) -> BoolArray:
        random = own_stream(seed, "dropout", self.stream)
        begins = np.flatnonzero(random.uniform(size=n) < self.probability)
        lengths = random.integers(1, self.longest + 1, size=n)[begins]
        depth = np.zeros(n + self.longest, dtype=np.int64)  # how many gaps open, less how many close, at each sample
        np.add.at(depth, begins, 1)
        np.add.at(depth, begins + lengths, -1)
        return np.asarray(np.cumsum(depth)[:n] > 0)
