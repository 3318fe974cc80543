"""Views of compiled code, and the moves of their numbers, against NumPy."""

import numpy as np
import pytest
from numba import njit

from jerkbench.arrays import WIDE
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import (
    Lanes,
    View,
    ask_for,
    copy,
    eights,
    fields_of,
    gather,
    lane,
    room,
    row,
    runs_in,
    spread,
    taken,
    wide_room,
)

SCATTERED = (31, 0, 9, 17, 8, 16, 24, 7, 2, 3)


def run_type(width):
    """Fields whose elements lie in order, at uneven places, and one without axes."""
    fields, length = fields_of({"lost": (), "A": (2, 3), "many": (40,)}, width)
    begin = fields["many"].places[0]
    odd = View((5, 2), [begin + width * place for place in SCATTERED], width)
    return Lanes({**fields, "odd": odd}, {"n": 3, "length": length}, width)


ONE, EIGHT = run_type(1), run_type(WIDE)


@njit
def fill_one(array):
    run = runs_in(array, ONE)
    for a in range(2):
        for b in range(run.n):
            run.A[a, b] = 10.0 * a + b
    run.A[1, 2] += run.zero + run.width
    run.lost = run.A[1, 0] + run.lost
    for e in range(5):
        run.odd[e, 1] = e + 0.5


@njit
def fill_eight(array):
    run = runs_in(array, EIGHT)
    for a in range(2):
        for b in range(run.n):
            run.A[a, b] = run.lost * (10.0 * a + b)
    for k in range(run.width):
        alone = lane(run, k)
        alone.odd[4, 1] = alone.A[1, 1] + alone.width
        alone.lost = 0.5


@njit
def copy_one(array, into):
    run = runs_in(array, ONE)
    copy(row(into, 1, run, "5 2"), run.odd)


@njit
def copy_eight(array, into):
    run = runs_in(array, EIGHT)
    copy(row(into, 1, run, "5 2"), run.odd)


@njit
def there_and_back(array, into, back):
    spread(into, runs_in(array, EIGHT).odd)
    gather(runs_in(back, EIGHT).odd, into)


@njit
def one_there_and_back(array, into, back):
    spread(into, runs_in(array, ONE).odd)
    gather(runs_in(back, ONE).odd, into)


@njit
def by_way_of_rooms(given, result):
    run = runs_in(given, EIGHT)
    own, wide, out = room(run, "2 n"), wide_room(run, "2"), row(result, 0, run, "2 n")
    for a in range(2):
        wide[a] = run.A[a, 0]
        for b in range(run.n):
            own[1 - a, b] = run.A[a, b] + taken(np.arange(6.0).reshape(2, 3, 1), 1, run, "3")[b] + wide[0] - wide[0]
    for a in range(2):
        for b in range(run.n):
            out[a, b] = own[a, b]


@njit
def eight_numbers(given, result):
    six = room(runs_in(given, ONE), "2 8")
    copy(six, row(given, 0, runs_in(given, ONE), "2 8"))
    row(result, 0, runs_in(result, EIGHT), "1")[0] = eights(six)[0] + eights(six)[1]


@njit
def ask(given, index):
    ask_for(row(given, index, runs_in(given, EIGHT), "2"))
    return given[0]


def test_the_fields_of_one_run_lie_where_its_type_says():
    array = aligned_zeros(ONE.sizes["length"])
    array[0] = 2.0
    fill_one(array)
    np.testing.assert_array_equal(array[:7], [12.0, 0.0, 1.0, 2.0, 10.0, 11.0, 13.0])
    np.testing.assert_array_equal(array[7:][list(SCATTERED[1::2])], np.arange(5) + 0.5)
    assert np.count_nonzero(array) == 11


def test_of_several_runs_each_has_its_own_numbers():
    array = aligned_zeros(EIGHT.sizes["length"])
    array[:WIDE] = lost = np.arange(1.0, 9.0)
    fill_eight(array)
    wide = array.reshape(-1, WIDE)
    np.testing.assert_array_equal(wide[1:7], np.outer([0, 1, 2, 10, 11, 12], lost))
    np.testing.assert_array_equal(wide[7 + SCATTERED[-1]], 11 * lost + 1)
    np.testing.assert_array_equal(wide[0], 0.5)


@pytest.mark.parametrize(("copied", "width"), [(copy_one, 1), (copy_eight, WIDE)])
def test_a_copy_lies_in_order(copied, width):
    given = np.random.default_rng(0).normal(size=(47, width))
    into = np.zeros((2, 10, width))
    copied(given.ravel(), into)
    np.testing.assert_array_equal(into[1], given[7:][list(SCATTERED)])
    assert not into[0].any()


def test_spread_writes_run_by_run_and_gather_takes_it_back():
    given, into, back = np.random.default_rng(0).normal(size=(47, WIDE)), np.zeros((WIDE, 16)), np.zeros((47, WIDE))
    there_and_back(given.ravel(), into, back.ravel())
    np.testing.assert_array_equal(into[:, :10], given[7:][list(SCATTERED)].T)
    np.testing.assert_array_equal(back[7:][list(SCATTERED)], given[7:][list(SCATTERED)])
    assert np.count_nonzero(back) == 10 * WIDE


def test_of_a_single_run_they_move_its_numbers():
    given, into, back = np.random.default_rng(0).normal(size=47), np.zeros((1, 16)), np.zeros(47)
    one_there_and_back(given, into, back)
    np.testing.assert_array_equal(into[0, :10], given[7:][list(SCATTERED)])
    np.testing.assert_array_equal(back[7:][list(SCATTERED)], given[7:][list(SCATTERED)])
    assert np.count_nonzero(back) == 10


def test_a_room_keeps_what_is_written():
    given, result = np.arange(47.0 * WIDE), np.zeros((6, WIDE))
    by_way_of_rooms(given, result)
    A = given.reshape(47, WIDE)[1:7].reshape(2, 3, WIDE)
    np.testing.assert_array_equal(result.reshape(2, 3, WIDE), A[::-1] + np.arange(3.0, 6.0)[:, None])


def test_rows_of_eight_numbers_are_vectors():
    given, result = np.arange(47.0), np.zeros(WIDE)
    eight_numbers(given, result)
    np.testing.assert_array_equal(result, given[:8] + given[8:16])


def test_what_is_asked_for_may_lie_beyond_the_end():
    given = np.ones(EIGHT.sizes["length"])
    assert ask(given, 0) == ask(given, 10**9) == 1.0


def test_types_that_lie_otherwise_have_other_names():
    """The name of a type is its content for numba, and in the key of what is kept on the disk."""
    moved = Lanes({**ONE.fields, "odd": View((5, 2), range(10), 1)}, {"n": 3, "length": 47}, 1)
    assert len({ONE.name, EIGHT.name, moved.name, Lanes(ONE.fields, {"n": 4, "length": 47}, 1).name}) == 4
    assert run_type(1) == ONE
    assert View((2, 3), range(6), 1) != View((3, 2), range(6), 1)


def test_aligned_zeros_begin_with_a_line_of_the_cache():
    for length in (1, 5, 100):
        zeros = aligned_zeros(length)
        assert zeros.shape == (length,)
        assert zeros.ctypes.data % (8 * WIDE) == 0
        assert not zeros.any()
