"""Multipath: fixes that are off on one axis for some seconds, and do not say so."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import Bursts
from jerkbench.plugins import register


@register("disturbance", "multipath_single_axis")
@dataclass(frozen=True)
class MultipathSingleAxis(Bursts):
    """Bursts in which the position is off by a constant on one axis; the reported covariance does not change.

    The offset of a burst is o = s d e_i, with the axis i of east, north, up, the sign s and the size d at random.
    """

    stream_name: ClassVar[str] = "multipath_single_axis"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU, one axis each."""
        sizes = self._sizes(random, (self.bursts,))
        return np.asarray(np.eye(3)[random.integers(3, size=self.bursts)] * sizes[:, None])
