"""The start of the tilt filter: the mean of the first second of rest, or level when it moves from the start."""

import numpy as np

from jerkbench.attitude.tilt import TiltStart
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording

ALIGNMENT_S = 1.0
"""The rest that the alignment uses at most, and needs at least."""

STATIC_VARIANCE = 1e-3
LEVEL_VARIANCE = 0.03


def align(recording: Recording, variance: float | None) -> TiltStart:
    """Return the state before the first sample.

    At rest for the first second: x is the normalised mean of its specific force, P = 1e-3 I. Moving: x = (0, 0, 1),
    P = 0.03 I. ``variance`` replaces either of the two.

    Raises:
        RecordingError: the accelerometer shows no gravity in the first second.
    """
    if recording.static_start_s < ALIGNMENT_S:
        return TiltStart(np.array([0.0, 0.0, 1.0]), LEVEL_VARIANCE if variance is None else variance)
    imu = recording.inertial
    mean = imu.accel_mps2[imu.t_s < imu.t_s[0] + ALIGNMENT_S].mean(axis=0)
    norm = float(np.linalg.norm(mean))
    if not norm > 0:
        raise RecordingError(
            f"{recording.name}: the accelerometer's mean over the first second is zero, so that no tilt can be read"
            " from it; specific force must contain gravity."
        )
    return TiltStart(mean / norm, STATIC_VARIANCE if variance is None else variance)
