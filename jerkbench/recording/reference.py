"""The reference of a recording: what estimates are compared with."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, require_times
from jerkbench.errors import RecordingError
from jerkbench.recording.freezing import freeze


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference of the estimates, at its own stamps.

    Attributes:
        t_s: (k,) stamps.
        source: one phrase: where it comes from.
        independent: whether it shares nothing with the measurements that the filters get.
        enu_m: (k, 3) position, or None. NaN: not known there.
        velocity_mps: (k, 3) in ENU, or None.
        euler_rad: (k, 3) roll, pitch, yaw, or None.
        scored: (k,) whether errors count there (default: everywhere).
    """

    t_s: FloatArray
    source: str
    independent: bool
    enu_m: FloatArray | None = None
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    scored: BoolArray = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        """Check shapes and times; fill in ``scored``."""
        freeze(self, t_s=(None,))
        k = len(self.t_s)
        freeze(self, enu_m=(k, 3), velocity_mps=(k, 3), euler_rad=(k, 3))
        require_times(self, self.t_s)
        scored = np.ones(k, dtype=bool) if self.scored is None else np.array(self.scored, dtype=bool)
        if scored.shape != (k,):
            raise RecordingError(f"Reference.scored has shape {scored.shape}; it must be ({k},).")
        scored.flags.writeable = False
        object.__setattr__(self, "scored", scored)

    @property
    def empty(self) -> bool:
        """Whether it knows nothing: no position, no velocity, no attitude."""
        return self.enu_m is None and self.velocity_mps is None and self.euler_rad is None
