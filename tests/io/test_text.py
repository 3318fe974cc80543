import tracemalloc

import numpy as np
import pytest

from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError
from jerkbench.io.text import cut_ends, parse_numbers, read_lines, require_increasing


def written(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    return path


def test_numbers_are_read_and_blank_lines_and_crlf_do_not_matter(tmp_path):
    path = written(tmp_path, b"1,2.5\r\n\r\n-3e1, 4\r\n")
    table = parse_numbers(path, read_lines(path), 2, ",")
    np.testing.assert_array_equal(table, [[1.0, 2.5], [-30.0, 4.0]])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"1,2\n3\n5,6\n", "line 2 has 1 fields; it must have 2"),
        (b"1,2\n3,4,5\n", "line 2 has 3 fields"),
        (b"1,2\n\n3,x4\n", "line 3, field 2 is 'x4', not a finite number"),
        (b"1,nan\n", "line 1, field 2 is 'nan'"),
        (b"1,2\ninf,2\n", "line 2, field 1 is 'inf'"),
        (b"1,2\n\x00\x00\xff\n", "line 2 has 1 fields"),
        (b"1_0,2\n", "line 1, field 1 is '1_0'"),
        (b"1,\n", "line 1, field 2 is ''"),
    ],
)
def test_a_damaged_line_is_named(tmp_path, content, said):
    path = written(tmp_path, content)
    with pytest.raises(RecordingError) as error:
        parse_numbers(path, read_lines(path), 2, ",")
    assert said in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("content", [b"", b"\n\n  \n"])
def test_an_empty_file_is_named(tmp_path, content):
    path = written(tmp_path, content)
    with pytest.raises(RecordingError, match=r"log\.csv is empty"):
        read_lines(path)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(RecordingError, match=r"There is no file .*gone\.csv"):
        read_lines(tmp_path / "gone.csv")
    with pytest.raises(RecordingError, match="cannot be read: Is a directory"):
        read_lines(tmp_path)


def test_a_time_that_stands_still_is_named_by_its_line(tmp_path):
    path = written(tmp_path, b"1\n\n2\n2\n")
    with pytest.raises(RecordingError, match="line 4: the time does not increase"):
        require_increasing(path, read_lines(path), np.array([1.0, 2.0, 2.0]), "the time")


@pytest.mark.parametrize("read", ["text", "table"])
def test_a_line_of_megabytes_is_refused_in_words_and_in_little_memory(tmp_path, read):
    path = written(tmp_path, b"t,ax,ay,az,gx,gy,gz\n" + b"0,0,0,9.81,0,0,0\n" * 3 + b"1.5," * 8_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match="line 5 has more than 64 KiB"):
            read_lines(path) if read == "text" else Tables(str(tmp_path), imu_file="log.csv").load(0)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


def test_long_files_of_short_lines_are_read(tmp_path):
    path = written(tmp_path, b"1,2\r\n" * 500_000)
    assert len(read_lines(path)) == 500_000


@pytest.mark.parametrize(
    ("lines", "cut"),
    [
        (["1,2,3"] * 5, (False, False)),
        (["2,3", *["1,2,3"] * 5], (True, False)),
        ([*["1,2,3"] * 5, "1,2"], (False, True)),
        ([*["1,2,3"] * 5, "1,2,-"], (False, True)),
        (["e-5,2,3", *["1,2,3"] * 5, "1"], (True, True)),
        (["x,y,z", *["1,2,3"] * 5], (False, False)),  # names
        (["1,2,", *["1,2,3"] * 5], (False, False)),  # an entry that is missing in the middle of a log
        (["1,2", "1,2,3"], (False, False)),
    ],
)
def test_cut_lines_are_those_that_lack_fields_or_hold_half_a_number(lines, cut):
    assert cut_ends(lines, ",") == cut
