"""The simulated farm robot with the sensors of old numbers, and with sensors that err as real ones do."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.datasets.field import Field
from jerkbench.plugins import register


@register("dataset", "field_v1")
@dataclass(frozen=True)
class FieldV1(Field):
    """The simulated farm robot of the numbers published so far: GNSS noise is white, and nothing is late.

    It is what `field` is today, to the bit, and stays so. Equations and parameters as in `field`.
    """

    recording_name: ClassVar[str] = "field_v1"


@register("dataset", "field_v2")
@dataclass(frozen=True)
class FieldV2(Field):
    """The simulated farm robot (`field`) with sensors whose errors last: coloured noise, a latency, a lever arm.

    A filter that takes each measurement's noise for new is too sure of itself here, as it is on real fixes. Where the
    defaults come from:

    - position, share .7 and 5 s: the receiver of rtklib_drive_0708 at rest (33 s, 145 fixed solutions), whose
      autocorrelation from .25 to 3 s fits .72 exp(-t/4.7 s) east, .58 exp(-t/1.8 s) north, .82 exp(-t/6.7 s) up. The
      one of comma2k19, under way, lasts longer: shares of 1 and 5.8, 12.7 and 17.9 s.
    - velocity, share .5 and 2 s: the wheel speed of comma2k19 against its reference (60 s), .53 exp(-t/1.9 s).
    - heading, share .5 and 30 s; latency .01 s and arm (1, 1, 2) cm: assumed, as what is left when lags were estimated
      and the arm was measured with a tape; no recording here shows them.

    Everything else, equations and parameters too, as in `field`.
    """

    recording_name: ClassVar[str] = "field_v2"

    position_coloured_share: float = 0.7
    position_coloured_time_s: float = 5.0
    velocity_coloured_share: float = 0.5
    velocity_coloured_time_s: float = 2.0
    heading_coloured_share: float = 0.5
    heading_coloured_time_s: float = 30.0
    position_latency_s: float = 0.01
    lever_arm_error_m: tuple[float, ...] = (0.01, 0.01, 0.02)
