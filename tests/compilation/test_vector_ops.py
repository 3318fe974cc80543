"""Vectors of compiled code against NumPy."""

import numpy as np
import pytest
from numba import njit

from jerkbench.compilation.vector_ops import fetch, picked, scratch, transpose
from jerkbench.compilation.vectors import WIDTH, aligned_zeros, vectors

PLACES = (31, 0, 9, 17, 8, 16, 24, 7)


@njit
def pick(given, result):
    w = vectors(given)
    vectors(result)[0] = picked(w[0], w[1], w[2], w[3], PLACES)


@njit
def turn(given, result, at, step):
    w = vectors(given)
    transpose(vectors(result), at, step, (w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]))


@njit
def by_way_of_scratch(given, result):
    w, out, room = vectors(given), vectors(result), scratch(4)
    for k in range(4):
        room[3 - k] = w[k]
    for k in range(4):
        out[k] = room[k]


@njit
def ask_for(given, index):
    w = vectors(given)
    fetch(w, index)
    return given[0]


def test_picked_takes_numbers_of_four_vectors():
    given, result = np.arange(4.0 * WIDTH), np.zeros(WIDTH)
    pick(given, result)
    np.testing.assert_array_equal(result, PLACES)


@pytest.mark.parametrize(("at", "step"), [(0, 1), (2, 1), (1, 3)])
def test_transpose_writes_rows_as_columns(at, step):
    given, result = np.random.default_rng(0).normal(size=(WIDTH, WIDTH)), np.zeros((at + step * WIDTH, WIDTH))
    turn(given, result, at, step)
    np.testing.assert_array_equal(result[at::step][:WIDTH], given.T)
    assert np.count_nonzero(result) == WIDTH**2


def test_scratch_keeps_what_is_written():
    given, result = np.arange(4.0 * WIDTH).reshape(4, WIDTH), np.zeros((4, WIDTH))
    by_way_of_scratch(given, result)
    np.testing.assert_array_equal(result, given[::-1])


def test_what_is_fetched_may_lie_beyond_the_end():
    given = np.ones(WIDTH)
    assert ask_for(given, 0) == ask_for(given, 10**9) == 1.0


def test_aligned_zeros_begin_with_a_line_of_the_cache():
    for length in (1, 5, 100):
        zeros = aligned_zeros(length)
        assert zeros.shape == (length,)
        assert zeros.ctypes.data % (8 * WIDTH) == 0
        assert not zeros.any()
