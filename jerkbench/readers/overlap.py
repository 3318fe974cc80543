"""The time that streams of one recording have in common; none is a sign of another clock or another drive."""

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording


def with_common_time(recording: Recording, way_out: str) -> Recording:
    """Return the recording, whose streams all overlap its IMU's times, or, without an IMU, its positions'.

    Args:
        recording: the recording.
        way_out: what to do otherwise, from "check" on.

    Raises:
        RecordingError: a stream has no time in common with these; says when both were.
    """
    known = None if recording.reference.empty else recording.reference
    streams = {
        "positions": recording.position,
        "velocities": recording.velocity,
        "headings": recording.heading,
        "reference": known,
    }
    clock_s, whose = recording.clock_s, "IMU is"
    if recording.imu is None and recording.position is not None:
        clock_s, whose = recording.position.t_s, "positions are"
    for name, stream in streams.items():
        if stream is not None and len(stream.t_s) and not _meet(stream.t_s, clock_s):
            raise RecordingError(
                f"{recording.name}: the {name} are from {stream.t_s[0]:.3f} to {stream.t_s[-1]:.3f} s, and the {whose}"
                f" from {clock_s[0]:.3f} to {clock_s[-1]:.3f} s: they have no time in common; {way_out}."
            )
    return recording


def _meet(one_s: FloatArray, other_s: FloatArray) -> bool:
    return bool(one_s[0] <= other_s[-1] and other_s[0] <= one_s[-1])
