import tracemalloc

import pytest

from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError
from jerkbench.io.text import read_lines


def written(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    return path


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
