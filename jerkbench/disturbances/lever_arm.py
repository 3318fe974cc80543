"""An antenna that is not where the filter takes it to be."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import nearest_rows
from jerkbench.disturbances.common import Once, fixes_of, squares, with_errors
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "lever_arm")
@dataclass(frozen=True)
class LeverArm(Once):
    """Fixes of an antenna whose lever arm is off: an error that turns with the vehicle and tilts with it.

    With the attitude Omega of the reference at the stamp nearest to the fix, and what is left of the arm l (forward,
    left, up) when the arm as measured has been taken off::

        z' = z + Omega l,  R_true' = R_true + o o' with o = Omega l,  R' = R

    A velocity is that of wheels; it stays as it is, and so does a fix where the reference knows no attitude.

    Attributes:
        forward_m: l, forward.
        left_m: l, to the left.
        up_m: l, upwards.
    """

    seeded: ClassVar[bool] = False

    forward_m: float = 0.1
    left_m: float = 0.05
    up_m: float = 0.1

    def __post_init__(self) -> None:
        """Check that the arm is finite."""
        for name in ("forward_m", "left_m", "up_m"):
            if not np.isfinite(getattr(self, name)):
                raise PluginError(f"{name} is {getattr(self, name)}; give a finite length, in metres.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the antenna moved.

        Raises:
            RecordingError: it has no position, or its reference knows no attitude.
        """
        position, reference = (
            fixes_of(recording, "so no antenna can be moved; leave lever_arm out."),
            recording.reference,
        )
        euler = reference.euler_rad
        if euler is None or not len(euler):
            raise RecordingError(
                f"{recording.name} has no attitude in its reference, which lever_arm turns the arm with."
            )
        at_fixes = euler[nearest_rows(reference.t_s, position.t_s)]
        known = np.isfinite(at_fixes).all(axis=1, keepdims=True)
        arm = np.array([self.forward_m, self.left_m, self.up_m])
        offset = np.where(known, dcm_from_euler(np.where(known, at_fixes, 0.0)) @ arm, 0.0)
        return replace(recording, position=with_errors(position, offset, squares(offset)))
