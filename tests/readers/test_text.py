import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.readers.text import parse_numbers, read_lines, require_increasing


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
