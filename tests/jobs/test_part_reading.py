"""Parts are read without threads of pyarrow's: one that outlives the interpreter aborts the process."""

import subprocess
import sys
from pathlib import Path

import pytest

READ_FIVE_TIMES = """
import os
from jerkbench.jobs.parts import RowBlock
from jerkbench.jobs.parts import content_digest, content_of, part_of, table_of
from stored_cells import about, row

content = content_of(table_of([RowBlock("abc", 1, [row()], about())]))
before = len(os.listdir("/proc/self/task"))
for _ in range(5):
    assert part_of(content, content_digest(content)).num_rows == 1
print(len(os.listdir("/proc/self/task")) - before)
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads are counted in /proc, which is not there")
def test_reading_a_part_starts_no_thread():
    helpers = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(helpers)!r})\n{READ_FIVE_TIMES}"],
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.stdout == "0\n", done.stderr
