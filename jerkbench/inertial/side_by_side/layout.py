"""The parts of a run: those of the kernel, and the rest of the nominal state."""

from functools import cache

from jerkbench.compilation.views import Run
from jerkbench.kinematic.layout import type_with

QUANTITIES = 5
"""Position, velocity, attitude, and the biases of gyro and accelerometer."""


@cache
def inertial_type(width: int) -> Run:
    """Return the type of ``width`` runs."""
    shapes: dict[str, tuple[int, ...]] = {
        "C": (3, 3),  # attitude, body to ENU
        "gyro_bias": (3,),
        "accel_bias": (3,),
        "rate": (3,),
        "force": (3,),
        "turn": (3, 3),  # the rotation of a step, or of a correction
        "next": (3, 3),
        "before": (3, 3),  # attitude before a correction
        "back": (3, 3),  # from the body after it to that before it
        "lever": (3, 3),  # -dt C, with C and the specific force a in the middle of a step
        "twist": (3,),  # -dt a
        "square_of_angle": (),
        "sine": (),  # sin(a)/a of the angle a of a rotation
        "cosine": (),  # (1 - cos(a))/a^2
        "innovation": (),  # of a yaw
        "measured": (),  # 1 where there is one, else 0
    }
    return type_with(shapes, QUANTITIES, width)
