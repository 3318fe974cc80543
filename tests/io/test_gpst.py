from datetime import UTC, datetime

from jerkbench.io.clocks import utc_of


def test_the_public_time_of_a_gps_week_gives_utc():
    # GPS week 2374 begins on Sunday 2025-07-06 00:00 GPST: 1980-01-06 plus 2374 weeks
    week_ns = (datetime(1980, 1, 6, tzinfo=UTC).timestamp() + 2374 * 7 * 86400) * 1e9
    assert utc_of(int(week_ns)) == datetime(2025, 7, 5, 23, 59, 42, tzinfo=UTC)


def test_leap_seconds_can_be_given():
    assert utc_of(0, gpst_minus_utc_s=0.0) == datetime(1970, 1, 1, tzinfo=UTC)
