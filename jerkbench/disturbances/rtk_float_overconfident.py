"""RTK that falls back to a float solution and still reports a fixed one."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.disturbances.rtk_float import RtkFloat
from jerkbench.plugins import register


@register("disturbance", "rtk_float_overconfident")
@dataclass(frozen=True)
class RtkFloatOverconfident(RtkFloat):
    """RTK float in the given windows with the same errors as `rtk_float`, but reported as if it were fixed: R' = R.

    Both draw from the same stream, so that the same seed gives the same errors and only the covariance differs.
    Only the true covariance knows.
    """

    honest: ClassVar[bool] = False
