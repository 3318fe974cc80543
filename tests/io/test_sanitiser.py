"""The sanitiser's checks on arrays, one at a time; on whole recordings they are tested in tests/io/ros."""

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.sanitiser import (
    steady_rows,
)


def test_fixes_that_all_leap_are_a_sentence():
    t_s = np.arange(5) * 0.1
    everywhere = 1e5 * np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [4, 3, -1], [-1, 4, 3]])
    with pytest.raises(RecordingError, match="All 5 fixes"):
        steady_rows(t_s, everywhere)
    steady, notes = steady_rows(t_s, 0 * everywhere)
    assert (steady.all(), notes) == (True, ())
