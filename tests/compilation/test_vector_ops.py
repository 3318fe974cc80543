"""Vectors of compiled code against NumPy."""

import numpy as np
import pytest
from numba import njit

from jerkbench.compilation.vector_ops import fetch, gather, picked, scatter, scratch
from jerkbench.compilation.vectors import WIDE, aligned_zeros, vectors, vectors_from

PLACES = (31, 0, 9, 17, 8, 16, 24, 7)


@njit
def pick(given, result):
    w = vectors(given, WIDE)
    vectors(result, WIDE)[0] = picked(w[0], w[1], w[2], w[3], PLACES)


@njit
def turn(given, result, at, step):
    w = vectors(given, WIDE)
    scatter(vectors(result, WIDE), at, step, (w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]))


@njit
def turn_one(given, result, at):
    w = vectors(given, 1)
    scatter(vectors(result, 1), at, 5, (w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]))


@njit
def turn_back(given, result, at, step):
    eight, out = gather(vectors(given, WIDE), at, step), vectors(result, WIDE)
    for k in range(8):
        out[k] = eight[k]


@njit
def turn_one_back(given, result, at):
    eight, out = gather(vectors(given, 1), at, 5), vectors(result, 1)
    for k in range(8):
        out[k] = eight[k]


@njit
def copy_from(given, result, first):
    vectors(result, WIDE)[0] = vectors_from(vectors(given, 1), first, WIDE)[0]


@njit
def by_way_of_scratch(given, result):
    w, out, room = vectors(given, WIDE), vectors(result, WIDE), scratch(4, WIDE)
    for k in range(4):
        room[3 - k] = w[k]
    for k in range(4):
        out[k] = room[k]


@njit
def ask_for(given, index):
    w = vectors(given, WIDE)
    fetch(w, index)
    return given[0]


def test_picked_takes_numbers_of_four_vectors():
    given, result = np.arange(4.0 * WIDE), np.zeros(WIDE)
    pick(given, result)
    np.testing.assert_array_equal(result, PLACES)


@pytest.mark.parametrize(("at", "step"), [(0, 1), (2, 1), (1, 3)])
def test_scatter_writes_rows_as_columns_and_gather_takes_them_back(at, step):
    given, result = np.random.default_rng(0).normal(size=(WIDE, WIDE)), np.zeros((at + step * WIDE, WIDE))
    turn(given, result, at, step)
    np.testing.assert_array_equal(result[at::step][:WIDE], given.T)
    assert np.count_nonzero(result) == WIDE**2
    back = np.zeros_like(given)
    turn_back(result, back, at, step)
    np.testing.assert_array_equal(back, given)


def test_of_a_single_run_they_move_eight_numbers():
    given, result, back = np.arange(1.0, 9.0), np.zeros(24), np.zeros(8)
    turn_one(given, result, 2)
    np.testing.assert_array_equal(result, [*np.zeros(16), *given])
    turn_one_back(result, back, 2)
    np.testing.assert_array_equal(back, given)


def test_vectors_may_begin_at_any_number():
    given, result = np.arange(20.0), np.zeros(WIDE)
    copy_from(given, result, 3)
    np.testing.assert_array_equal(result, given[3 : 3 + WIDE])


def test_scratch_keeps_what_is_written():
    given, result = np.arange(4.0 * WIDE).reshape(4, WIDE), np.zeros((4, WIDE))
    by_way_of_scratch(given, result)
    np.testing.assert_array_equal(result, given[::-1])


def test_what_is_fetched_may_lie_beyond_the_end():
    given = np.ones(WIDE)
    assert ask_for(given, 0) == ask_for(given, 10**9) == 1.0


def test_aligned_zeros_begin_with_a_line_of_the_cache():
    for length in (1, 5, 100):
        zeros = aligned_zeros(length)
        assert zeros.shape == (length,)
        assert zeros.ctypes.data % (8 * WIDE) == 0
        assert not zeros.any()
