"""Multipath, on one axis or on all."""

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


# Multipath: fixes that are off on all axes for some seconds, and do not say so.


@register("disturbance", "multipath_all_axes")
@dataclass(frozen=True)
class MultipathAllAxes(Bursts):
    """Bursts in which the position is off by a constant on each axis; the reported covariance does not change.

    The offset of a burst is o = (s_1 d_1, s_2 d_2, s_3 d_3), east, north, up, each sign and each size at random.
    All axes are bad at once: the comparison with `multipath_single_axis` shows what an adaptation gains by treating
    each axis by itself.
    """

    stream_name: ClassVar[str] = "multipath_all_axes"

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU."""
        return self._sizes(random, (self.bursts, 3))
