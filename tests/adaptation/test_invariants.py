"""The promises of each adaptation, on random innovations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.sage_husa import SageHusa
from jerkbench.adaptation.scalar_r import ScalarR
from jerkbench.contracts import empty_memory

ALL_ROWS = np.arange(6)


def random_case(rng, rows=ALL_ROWS, scale=3.0):
    """An innovation, HPH' and a full R, for the given rows."""
    m = len(rows)
    half = rng.normal(size=(2, m, 2 * m))
    HPHt, R = half @ half.transpose(0, 2, 1)
    return scale * rng.normal(size=m) * np.sqrt(np.diag(HPHt + R)), HPHt, R


CASES = st.builds(
    lambda seed, scale: random_case(np.random.default_rng(seed), scale=scale),
    st.integers(0, 2**32 - 1),
    st.floats(0.05, 50.0),
)
"""Covariances of any kind; a small scale is below the threshold, a large one far above."""


def adapt(adaptation, case, rows=ALL_ROWS, memory=None):
    memory = empty_memory(adaptation) if memory is None else memory
    return adaptation.adapt(*case, rows, memory)


@given(CASES)
def test_after_mtf_no_squared_innovation_exceeds_its_variance_and_off_diagonals_stay(case):
    y, HPHt, R = case
    adapted = adapt(Mtf(), case)

    assert (y @ y >= np.trace(HPHt) + np.trace(R)) == (adapted != R).any()
    if (adapted != R).any():
        assert (y**2 <= np.diag(HPHt + adapted) * (1 + 1e-12)).all()
    np.testing.assert_array_equal(adapted - np.diag(np.diag(adapted)), R - np.diag(np.diag(R)))


@given(CASES)
def test_after_scalar_r_the_trace_of_s_is_the_squared_innovation(case):
    y, HPHt, R = case
    adapted = adapt(ScalarR(), case)
    triggered = y @ y >= np.trace(HPHt) + np.trace(R)

    assert np.trace(HPHt + adapted) == pytest.approx(y @ y if triggered else np.trace(HPHt + R))
    np.testing.assert_allclose(adapted / R, adapted[0, 0] / R[0, 0])


def test_it_begins_after_so_many_updates_but_looks_on_before():
    hit = np.array([10.0, 0, 0, 0, 0, 0]), np.eye(6), np.eye(6)
    mtf, other = Mtf(window=4, after=3), Mtf(window=4)
    memory, others = empty_memory(mtf), empty_memory(other)
    late, early = ([adapt(rule, hit, memory=m)[0, 0] for _ in range(5)] for rule, m in ((mtf, memory), (other, others)))

    assert late == [1.0, 1.0, 1.0, *early[3:]]
    assert min(early) > 1.0


def test_memory_belongs_to_a_row_and_advances_only_when_it_is_there():
    sage, memory = SageHusa(), empty_memory(SageHusa())
    position, velocity = np.arange(3), np.arange(3, 6)
    y, eye = np.full(3, 5.0), np.eye(3)
    for _ in range(3):
        adapt(sage, (y, eye, eye), rows=position, memory=memory)
    adapted = adapt(sage, (y, eye, eye), rows=velocity, memory=memory)

    np.testing.assert_array_equal(memory[6:12], [3, 3, 3, 1, 1, 1])
    np.testing.assert_array_equal(adapted, eye)  # the first update of these rows takes the reported variance


def test_sage_husa_finds_the_true_variance_of_a_sensor_that_reports_too_little():
    rng, sage = np.random.default_rng(4), SageHusa(forgetting=0.995)
    memory, row, found = empty_memory(SageHusa()), np.array([0]), []
    for _ in range(4000):
        y = rng.normal(0.0, np.sqrt(2.0 + 9.0), 1)  # h = 2, the true r = 9, reported 1
        found.append(adapt(sage, (y, np.array([[2.0]]), np.array([[1.0]])), rows=row, memory=memory)[0, 0])

    assert np.mean(found[1000:]) == pytest.approx(9.0, rel=0.1)


def test_sage_husa_stays_between_its_bounds_and_makes_r_diagonal():
    rng, sage = np.random.default_rng(5), SageHusa(low=0.5, high=2.0)
    memory = empty_memory(sage)
    for k in range(50):
        case = random_case(rng, scale=10.0 if k % 2 else 0.01)
        adapted = adapt(sage, case, memory=memory)
        ratio = np.diag(adapted) / np.diag(case[2])
        assert ((ratio >= 0.5 - 1e-12) & (ratio <= 2.0 + 1e-12)).all()
        assert np.count_nonzero(adapted) == 6
