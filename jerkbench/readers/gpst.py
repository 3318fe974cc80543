"""GPS time (GPST) and UTC."""

from datetime import UTC, datetime, timedelta

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
