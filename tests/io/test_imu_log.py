import struct

import numpy as np
import pytest

from jerkbench.datasets.rtklib import LOG_ACCEL, LOG_GYRO, read_imu_log, read_time_tag
from jerkbench.errors import RecordingError

START = 1_752_003_261


def tag_bytes(last_ms, fraction=0.854, magic=b"TIMETAG RTKLIB demo5"):
    head = magic.ljust(60, b"\0") + struct.pack("<IId", 7, START, fraction)
    return head + struct.pack("<IIII", 131, 37, last_ms, 99)


def written(tmp_path, rows, tag):
    log, tag_path = tmp_path / "imu.csv", tmp_path / "imu.csv.tag"
    log.write_text("".join(f"{row}\n" for row in rows))
    tag_path.write_bytes(tag)
    return log, tag_path


def test_the_tag_stretches_the_sensors_clock(tmp_path):
    rows = ["1,2,3,4,5,6,5000", "7,8,9,10,11,12,5250", "0,0,0,0,0,0,6000"]
    start_gpst_ns, t_s, samples = read_imu_log(*written(tmp_path, rows, tag_bytes(1004)))
    assert start_gpst_ns == START * 10**9 + 854_000_000
    np.testing.assert_allclose(t_s, [0.0, 0.251, 1.004], rtol=1e-14)
    np.testing.assert_array_equal(samples.numbers(LOG_ACCEL)[0], [1, 2, 3])
    np.testing.assert_array_equal(samples.numbers(LOG_GYRO)[1], [10, 11, 12])


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["1,2,3,4,5,6,0", "1,2,3,4"], "imu.csv, row 2, column 7: 'nan' is not a time in ms"),
        (["1,2,3,4,5,6,0", "1,2,3,4,5,NaN,10"], "imu.csv, row 2, column 6: 'nan' is not a finite number"),
        (["ax,ay,az,gx,gy,gz,t"], "imu.csv, row 1, column 7: 't' is not a number"),
        (["1,2,3,4,5,6,10", "1,2,3,4,5,6,2", "1,2,3,4,5,6,20"], "imu.csv, row 2: the time is not later"),
        (["1,2,3,4,5,6,0", "1,2,3,4,5,6,900"], "covers 0.900 s, but its time tag imu.csv.tag covers 1.000 s"),
        ([], "imu.csv is empty"),
    ],
)
def test_a_damaged_log_is_named(tmp_path, rows, said):
    with pytest.raises(RecordingError) as error:
        read_imu_log(*written(tmp_path, rows, tag_bytes(1000)))
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (tag_bytes(1000, magic=b"PK\x03\x04"), "does not begin with 'TIMETAG RTKLIB'"),
        (tag_bytes(1000)[:-3], "has 89 bytes, but a time tag has 76 bytes and 8 more bytes for each record"),
        (tag_bytes(1000)[:76], "has 76 bytes"),
        (tag_bytes(1000)[:40], "has 40 bytes"),
        (tag_bytes(1000, fraction=float("nan")), "the fractional second of the start is nan"),
        (tag_bytes(0), "the last record is at 0 ms"),
    ],
)
def test_a_damaged_tag_is_named(tmp_path, content, said):
    path = tmp_path / "imu.csv.tag"
    path.write_bytes(content)
    with pytest.raises(RecordingError) as error:
        read_time_tag(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("first", "last", "said"),
    [
        ("5,6,40", "1,2,3,4,5,6,100", "the first row is truncated"),
        ("1,2,3,4,5,6,40", "1,2,3,4", "the last row is truncated"),
        ("1,2,3,4,5,6,40", "1,2,3,4,5,6,10", "the last row is truncated"),
        ("5,6,40", "1,", "the first and the last rows are truncated: 2 dropped"),
    ],
)
def test_cut_ends_are_dropped_and_counted(tmp_path, first, last, said):
    whole = [f"1,2,3,4,5,6,{50 + 10 * k}" for k in range(5)]
    kept = [row for row in (first, *whole, last) if row.count(",") == 6 and not row.endswith(",10")]
    span_ms = int(kept[-1].split(",")[-1]) - int(kept[0].split(",")[-1])
    _, t_s, samples = read_imu_log(*written(tmp_path, [first, *whole, last], tag_bytes(span_ms)))
    assert len(t_s) == len(kept)
    assert [said in note for note in samples.notes] == [True]
