"""The sanitiser's checks on arrays, one at a time; on whole recordings they are tested in tests/io/ros."""

import numpy as np
import pytest

from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.bag import Messages
from jerkbench.io.sanitiser import (
    Finding,
    Ledger,
    frozen_rows,
    leaping_rows,
    ordered,
    report_jumps,
    steady_rows,
    with_late_enough_stamps,
)

SECOND = 10**9
NOW = 1_700_000_000 * SECOND


def messages(stamp_s, delay_s=0.02, **values):
    stamp_ns = NOW + np.round(np.asarray(stamp_s) * 1e9).astype(np.int64)
    bag_ns = NOW + np.arange(len(stamp_ns)) * SECOND // 10 + round(delay_s * 1e9)
    return Messages("/t", "type", "", "", bag_ns, stamp_ns, values)


def ledger(mode="repair"):
    return Ledger(mode, NOW)


def test_a_bad_stamp_is_repaired_with_the_delay_of_the_good_ones_of_its_own_stream():
    stamps = np.arange(10) / 10
    given = messages(stamps, delay_s=0.05)
    bad = np.arange(10) < 6  # most of them
    given = given.stamped(np.where(bad, 0, given.stamp_ns))
    book = ledger()
    repaired = with_late_enough_stamps("s", given, book, NOW - SECOND, 20_000_000)
    np.testing.assert_array_equal(repaired.stamp_ns, messages(stamps).stamp_ns)
    assert "less 0.050 s" in str(book.findings[0])


def test_the_order_is_restored_within_a_second_and_not_beyond():
    book = ledger()
    late = ordered("s", messages([0.0, 0.1, 0.3, 0.2, 0.4, 0.5]), book)
    np.testing.assert_array_equal(np.diff(late.stamp_ns), SECOND // 10)
    back = ordered("s", messages([5.0, 5.1, 5.2, 2.0, 5.4, 5.4]), book)
    np.testing.assert_array_equal(
        back.stamp_ns - NOW, [50 * SECOND // 10, 51 * SECOND // 10, 52 * SECOND // 10, 54 * SECOND // 10]
    )
    assert [finding.count for finding in book.findings] == [1, 1, 1]
    dropped = ordered("s", messages([0.0, 0.1, 0.3, 0.2, 0.4, 0.5]), ledger("drop"))
    assert len(dropped) == 5


def test_a_value_that_stays_is_frozen_from_ten_on():
    moving = np.arange(40.0)[:, None] * [1, 0, 0]
    nine, ten = moving.copy(), moving.copy()
    nine[10:19], ten[10:20] = nine[10], ten[10]
    assert not frozen_rows(nine).any()
    np.testing.assert_array_equal(np.flatnonzero(frozen_rows(ten)), np.arange(11, 20))
    start = moving.copy()
    start[:12] = 0
    np.testing.assert_array_equal(np.flatnonzero(frozen_rows(start)), np.arange(12))  # nothing was measured yet
    assert not frozen_rows(np.empty((0, 3))).any()


def test_a_fast_drive_does_not_leap():
    t_s = np.arange(20) * 0.4
    drive = np.outer(t_s, [60.0, 0, 0])  # 216 km/h
    assert not leaping_rows(t_s, drive).any()
    for row in (0, 1, 9, 18, 19):
        hurt = drive.copy()
        hurt[row, 1] += 500
        np.testing.assert_array_equal(np.flatnonzero(leaping_rows(t_s, hurt)), [row])


@pytest.mark.parametrize("every", [1, 2, 5])
def test_a_position_is_judged_by_the_axes_that_it_has(every):
    """At 110 m, a height in every few rows only; the height of one of these leaps, and one place that has no height."""
    t_s = np.arange(60) * 0.1
    drive = np.column_stack([10 * t_s, 0 * t_s, 110 + t_s])
    drive[np.arange(60) % every > 0, 2] = np.nan
    assert not leaping_rows(t_s, drive).any()
    hurt = drive.copy()
    hurt[20, 2] += 5000
    hurt[31, 0] -= 5000
    np.testing.assert_array_equal(np.flatnonzero(leaping_rows(t_s, hurt)), [20, 31])


def test_axes_that_are_there_in_every_row_are_judged_by_their_distance():
    rng = np.random.default_rng(3)
    t_s, drive = np.arange(40) * 0.2, rng.normal(0, 80, (40, 3))
    rows = [np.arange(5) + min(max(k - 2, 0), 35) for k in range(40)]
    far_m = [np.linalg.norm(drive[k] - np.median(drive[around], axis=0)) for k, around in enumerate(rows)]
    np.testing.assert_array_equal(leaping_rows(t_s, drive), np.array(far_m) > 50 + 100 * 0.8)
    assert 0 < leaping_rows(t_s, drive).sum() < 40
    assert not leaping_rows(t_s[:4], 1e6 * drive[:4]).any()  # too few to say which of them it is


def test_fixes_that_all_leap_are_a_sentence():
    t_s = np.arange(5) * 0.1
    everywhere = 1e5 * np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [4, 3, -1], [-1, 4, 3]])
    with pytest.raises(RecordingError, match="All 5 fixes"):
        steady_rows(t_s, everywhere)
    steady, notes = steady_rows(t_s, 0 * everywhere)
    assert (steady.all(), notes) == (True, ())


@pytest.mark.parametrize("sign", ["status", "covariance"])
def test_a_jump_counts_only_where_the_kind_of_fix_changes(sign):
    p = np.outer(np.arange(20) / 10, [1.0, 0, 0])
    p[8:] += [0, 5, 0]
    p[14:] += [0, 5, 0]
    changes = np.arange(20) >= 8  # at the first of the two jumps
    sigma = np.where(changes & (sign == "covariance"), 0.5, 0.01)
    covariance = sigma[:, None] ** 2 * np.eye(3).ravel()
    status = np.where(changes, 0.0, 2.0) if sign == "status" else None
    book = ledger()
    report_jumps("s", messages(np.arange(20) / 10, enu_m=p, position_covariance=covariance), book, "enu_m", status)
    (finding,) = book.findings
    assert (finding.count, finding.first_s) == (1, pytest.approx(0.82))
    smooth = p - np.where(changes, 5.0, 0.0)[:, None] * [0, 1, 0]
    quiet = ledger()
    report_jumps(
        "s", messages(np.arange(20) / 10, enu_m=smooth, position_covariance=covariance), quiet, "enu_m", status
    )
    assert quiet.findings == []


def test_a_finding_is_a_sentence():
    finding = Finding("imu (/imu)", "a gap before them", 2, 30, "kept", 1.234)
    assert str(finding) == "imu (/imu): 2 of 30 rows with a gap before them, the first 1.23 s into the bag: kept."
    with pytest.raises(PluginError, match=r"There is no sanitise mode 'mend'"):
        Ledger("mend", 0)
