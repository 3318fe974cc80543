"""The direction of gravity, as the accelerometer feels it."""

import numpy as np

from jerkbench.arrays import FloatArray


def felt_axis(accel_mps2: FloatArray) -> str:
    """Return the axis, "+z" for example, on which the median of specific forces (n, 3) is largest."""
    force = np.median(accel_mps2, axis=0)
    axis = int(np.argmax(np.abs(force)))
    return f"{'+' if force[axis] > 0 else '-'}{'xyz'[axis]}"


def gravity_notes(accel_mps2: FloatArray, parameter: str) -> tuple[str, ...]:
    """Return a note where a body's specific forces (n, 3) have gravity on another axis than +z, else none.

    Args:
        accel_mps2: in what is taken for the body's axes.
        parameter: which parameter turns the sensor's axes into the body's.
    """
    felt = felt_axis(accel_mps2)
    if felt == "+z":
        return ()
    note = (
        f"The IMU feels gravity on {felt}, and a body (forward, left, up) on +z: attitude and forces are wrong until"
        f" {parameter} says which of its axes point where."
    )
    return (note,)
