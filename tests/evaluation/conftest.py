"""The fixtures of a small run, of its reference and of the rows that count."""

import numpy as np
import pytest
from scored_run import make_estimate, make_recording

from jerkbench.evaluation.counted_rows import counted_rows


def once_a_second(t_s, rows):
    """The first of ``rows`` in each whole second, one after the other."""
    seconds, chosen = set(), []
    for row in rows:
        if int(t_s[row]) not in seconds:
            seconds.add(int(t_s[row]))
            chosen.append(row)
    return chosen


@pytest.fixture
def sampled(estimate, recording, counted):
    """The rows of the estimate that scores are taken of."""
    index = estimate.index
    located = [k for k in np.flatnonzero(counted) if np.isfinite(recording.reference.enu_m[index[k]]).all()]
    return once_a_second(recording.reference.t_s[index], located)


@pytest.fixture
def recording():
    return make_recording()


@pytest.fixture
def estimate(recording):
    return make_estimate(recording)


@pytest.fixture
def counted(estimate, recording):
    """The rows that count after a burn-in of 5 s."""
    return counted_rows(estimate, recording, 5.0)
