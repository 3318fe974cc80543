"""Clocks and stamps: GPST and UTC, dates as text, latency of streams, and the common time of streams."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording, Velocity

GPST_MINUS_UTC_S = 18.0
"""GPS time minus UTC. Valid from 2017-01-01 until another leap second is introduced (none was announced by 2025)."""

GPS_EPOCH_NS = 315_964_800_000_000_000
"""Epoch of GPS time, 1980-01-06, in nanoseconds since 1970."""

WEEK_NS = 604_800_000_000_000

UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc_of(gpst_ns: int, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> datetime:
    """Convert a GPS time, in nanoseconds since 1970 on the GPS calendar, to UTC, rounded to microseconds.

    >>> utc_of(1_752_003_261_854_000_000).isoformat()
    '2025-07-08T19:34:03.854000+00:00'
    """
    return UNIX_EPOCH + timedelta(microseconds=round(gpst_ns / 1000)) - timedelta(seconds=gpst_minus_utc_s)


def ns_since_1970(moment: datetime) -> int:
    """Convert a UTC time to nanoseconds since 1970."""
    return (moment - UNIX_EPOCH) // timedelta(microseconds=1) * 1000


# Conversion of a date and a time of day from text to nanoseconds.


def calendar_ns(date: str, time: str) -> int | None:
    """Convert a date (``2011-09-26``) and time (``13:02:25.594``) to nanoseconds since 1970, or invalid text to None.

    >>> calendar_ns("1970-01-02", "00:00:01.5")
    86401500000000
    """
    if date[:2] not in ("19", "20", "21") or len(date) != len("2011-09-26") or set(time) - set("0123456789:."):
        return None
    try:
        return int(np.datetime64(f"{date}T{time}", "ns").astype(np.int64))
    except ValueError:  # for example the 31st of April
        return None


# Streams whose axes have a common stamp but different latencies.


def velocity_when_true(
    t_s: FloatArray, enu_mps: FloatArray, covariance_m2ps2: FloatArray, latency_s: tuple[float, ...]
) -> Velocity:
    """Assign each axis of an ENU velocity to its time of validity: the stamp minus the latency of the axis.

    Axes that were valid at the same time are in one row, with their cross-covariance. The other axes of a row are NaN.

    Args:
        t_s: (m,) stamps of the velocities [s].
        enu_mps: (m, 3) velocities in ENU [m/s].
        covariance_m2ps2: (m, 3, 3) covariances of the velocities [m2/s2].
        latency_s: latencies of the axes east, north and up [s].

    Returns:
        The velocities in the order of time, with at most 3 m rows.
    """
    valid_ns = np.round((t_s[:, None] - np.array(latency_s)) * 1e9).astype(np.int64)
    grid_ns, inverse = np.unique(valid_ns, return_inverse=True)
    rows = inverse.reshape(valid_ns.shape)
    mps, covariance = np.full((len(grid_ns), 3), np.nan), np.tile(np.eye(3), (len(grid_ns), 1, 1))
    for i in range(3):
        mps[rows[:, i], i] = enu_mps[:, i]
        for j in range(3):
            same = rows[:, i] == rows[:, j]
            covariance[rows[same, i], i, j] = covariance_m2ps2[same, i, j]
    return Velocity(grid_ns * 1e-9, mps, covariance)


# Check that the streams of a recording overlap in time. Streams that do not overlap have different clocks or drives.


def with_common_time(recording: Recording, way_out: str) -> Recording:
    """Return the recording, after a check that each stream overlaps in time with the IMU.

    In a recording without an IMU, each stream must overlap in time with the positions.

    Args:
        recording: the recording to check.
        way_out: advice at the end of the error message; it starts with the word "check".

    Raises:
        RecordingError: two streams do not overlap. The message contains the times of both streams.
    """
    known = None if recording.reference.empty else recording.reference
    measured = recording.position, recording.velocity, recording.heading
    streams = dict(zip(("positions", "velocities", "headings", "reference"), (*measured, known), strict=True))
    clock_s, whose = recording.clock_s, "IMU"
    if recording.imu is None and recording.position is not None:
        clock_s, whose = recording.position.t_s, "positions"
    for name, stream in streams.items():
        if stream is None or not len(stream.t_s):
            continue
        if stream.t_s[0] > clock_s[-1] or clock_s[0] > stream.t_s[-1]:
            raise RecordingError(
                f"{recording.name}: the {name} ({stream.t_s[0]:.3f} to {stream.t_s[-1]:.3f} s) and the {whose}"
                f" ({clock_s[0]:.3f} to {clock_s[-1]:.3f} s) do not overlap in time; {way_out}."
            )
    return recording


# Outages that occurred during the recording.


def with_recorded_outages(recording: Recording, shortest_s: float) -> Recording:
    """Return the recording with an outage for each gap between two fixes that is longer than ``shortest_s``.

    Args:
        recording: the recording; its existing outages are preserved.
        shortest_s: minimum length of an added outage [s], or 0 to add no outages.

    Raises:
        RecordingError: the reference has no positions in the gaps, for example because the fixes are the reference.
    """
    if not shortest_s or recording.position is None:
        return recording
    fix_s = recording.position.t_s[np.isfinite(recording.position.enu_m[:, :2]).all(axis=1)]
    long = np.flatnonzero(np.diff(fix_s) > shortest_s)
    windows_s = np.column_stack([fix_s[long], fix_s[long + 1]])
    begin_s, end_s = recording.outages_s[:, 0], recording.outages_s[:, 1]
    windows_s = windows_s[~((windows_s[:, :1] < end_s) & (windows_s[:, 1:] > begin_s)).any(axis=1)]
    truth_s = recording.reference.t_s if recording.reference.enu_m is not None else np.empty(0)
    if len(windows_s) and not ((truth_s > windows_s[:, :1]) & (truth_s < windows_s[:, 1:])).any():
        raise RecordingError(
            f"{recording.name}: outage_s is {shortest_s:g}, but the reference has no position in any of the"
            f" {len(windows_s)} gaps between fixes; give a separate reference, or set outage_s=0."
        )
    return replace(recording, outages_s=np.concatenate([recording.outages_s, windows_s]))
