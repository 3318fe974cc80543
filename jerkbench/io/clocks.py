"""Clocks and stamps: GPST and UTC, dates as text, latency of streams, and the time that streams have in common."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Recording, Velocity

GPST_MINUS_UTC_S = 18.0
"""GPST less UTC. Valid since 2017-01-01 and for as long as no further leap second is announced (none is by 2025)."""

GPS_EPOCH_NS = 315_964_800_000_000_000
"""GPST's first moment, 1980-01-06, in nanoseconds of the calendar since 1970."""

WEEK_NS = 604_800_000_000_000

UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc_of(gpst_ns: int, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> datetime:
    """Return the UTC of a GPST given as nanoseconds of its calendar since 1970 (to the microsecond).

    >>> utc_of(1_752_003_261_854_000_000).isoformat()
    '2025-07-08T19:34:03.854000+00:00'
    """
    return UNIX_EPOCH + timedelta(microseconds=round(gpst_ns / 1000)) - timedelta(seconds=gpst_minus_utc_s)


def ns_since_1970(moment: datetime) -> int:
    """Return nanoseconds since 1970 of a UTC."""
    return (moment - UNIX_EPOCH) // timedelta(microseconds=1) * 1000


# A date and a time of day, as text, to nanoseconds.

DATE = re.compile(r"(19|20|21)\d\d-\d\d-\d\d", re.ASCII)
"""Years that fit into 64 bits of nanoseconds."""

TIME = re.compile(r"\d\d:\d\d:\d\d(\.\d{1,12})?", re.ASCII)


def calendar_ns(date: str, time: str) -> int | None:
    """Return nanoseconds of the calendar since 1970 of ``2011-09-26``, ``13:02:25.594``; None where it is none.

    >>> calendar_ns("1970-01-02", "00:00:01.5")
    86401500000000
    """
    if not (DATE.fullmatch(date) and TIME.fullmatch(time)):
        return None
    try:
        return int(np.datetime64(f"{date}T{time}", "ns").astype(np.int64))
    except ValueError:  # the 31st of April
        return None


# Streams whose axes were true at different times before their common stamp.


def velocity_when_true(
    t_s: FloatArray, enu_mps: FloatArray, covariance_m2ps2: FloatArray, latency_s: tuple[float, ...]
) -> Velocity:
    """Put each axis of an ENU velocity at the time when it was true, its stamp less its latency.

    Axes that were true at the same time share a row and keep their cross-covariance; the others are NaN there.

    Args:
        t_s: (m,) stamps.
        enu_mps: (m, 3).
        covariance_m2ps2: (m, 3, 3).
        latency_s: of east, north, up.

    Returns:
        Up to 3 m rows in the order of time.
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


# The time that streams of one recording have in common; none is a sign of another clock or another
# drive.


def with_common_time(recording: Recording, way_out: str) -> Recording:
    """Return the recording, whose streams all overlap its IMU's times, or, without an IMU, its positions'.

    Args:
        recording: the recording.
        way_out: what to do otherwise, from "check" on.

    Raises:
        RecordingError: a stream has no time in common with these; says when both were.
    """
    known = None if recording.reference.empty else recording.reference
    measured = recording.position, recording.velocity, recording.heading
    streams = dict(zip(("positions", "velocities", "headings", "reference"), (*measured, known), strict=True))
    clock_s, whose = recording.clock_s, "IMU is"
    if recording.imu is None and recording.position is not None:
        clock_s, whose = recording.position.t_s, "positions are"
    for name, stream in streams.items():
        if stream is None or not len(stream.t_s):
            continue
        if stream.t_s[0] > clock_s[-1] or clock_s[0] > stream.t_s[-1]:
            raise RecordingError(
                f"{recording.name}: the {name} are from {stream.t_s[0]:.3f} to {stream.t_s[-1]:.3f} s, and the {whose}"
                f" from {clock_s[0]:.3f} to {clock_s[-1]:.3f} s: they have no time in common; {way_out}."
            )
    return recording


# The log's own outages.


def with_own_outages(recording: Recording, shortest_s: float) -> Recording:
    """Return the recording with each gap between two fixes that is longer than ``shortest_s`` as an outage.

    Args:
        recording: the recording.
        shortest_s: 0: no gap is an outage.

    Raises:
        RecordingError: the reference knows no places in the gaps, as where it is the fixes themselves.
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
            f"{recording.name}: outage_s is {shortest_s:g}, and the reference has no place in any of the"
            f" {len(windows_s)} gaps; give a reference of its own, or outage_s=0."
        )
    return replace(recording, outages_s=np.concatenate([recording.outages_s, windows_s]))
