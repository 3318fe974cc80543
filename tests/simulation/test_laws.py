import numpy as np
import pytest
from scipy import stats

from jerkbench.datasets.random_drive import law
from jerkbench.errors import PluginError


def draws(text, count=4000):
    """Values of a law, one after the other from one generator."""
    random = np.random.default_rng(20260101)
    return [law(text).draw(random, {}) for _ in range(count)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x ~ uniform -2 to 3.5", stats.uniform(-2, 5.5)),
        ("x ~ log_uniform 0.04 to 0.5", stats.loguniform(0.04, 0.5)),
        ("x ~ log_normal 1.5 sigma 0.4", stats.lognorm(0.4, scale=1.5)),
    ],
)
def test_numbers_follow_their_law(text, expected):
    assert stats.kstest(draws(text), expected.cdf).pvalue > 0.01


def test_a_value_may_be_fixed_and_one_may_follow_another():
    assert law("duration_s ~ always 60").draw(np.random.default_rng(0), {}) == 60.0
    assert law("gyro = accel * 0.025").draw(np.random.default_rng(0), {"accel": 0.2}) == 0.025 * 0.2
    assert law("force = drop * 20 12 30").draw(np.random.default_rng(0), {"drop": 0.1}) == (2.0, 12 * 0.1, 3.0)


def test_words_are_equally_likely():
    words, counts = np.unique(draws("trace ~ one_of a b c"), return_counts=True)

    assert list(words) == ["a", "b", "c"]
    assert stats.chisquare(counts).pvalue > 0.01


def test_times_are_sorted_and_uniform():
    times = np.array(draws("t ~ times 2 in 15 to 145"))

    assert (times[:, 0] <= times[:, 1]).all()
    assert stats.kstest(times.ravel(), stats.uniform(15, 130).cdf).pvalue > 0.01


def test_windows_are_uniform_in_number_length_and_place_and_do_not_overlap():
    drawn = draws("w ~ windows 1 to 3 of 2 to 10 in 15 to 145")
    counts = np.bincount([len(windows) for windows in drawn], minlength=4)
    lengths = [end - begin for windows in drawn for begin, end in windows]
    alone = np.array([windows[0] for windows in drawn if len(windows) == 1])

    assert counts[0] == 0
    assert stats.chisquare(counts[1:]).pvalue > 0.01
    assert stats.kstest(lengths, stats.uniform(2, 8).cdf).pvalue > 0.01
    share = (alone[:, 0] - 15) / (130 - np.diff(alone)[:, 0])
    assert stats.kstest(share, "uniform").pvalue > 0.01
    for windows in drawn:
        edges = np.ravel(windows)
        assert (np.diff(edges) >= 0).all()
        assert 15 <= edges[0] < edges[-1] <= 145


@pytest.mark.parametrize(
    "text",
    [
        "x ~ unifrom 0 to 1",
        "x ~ uniform 1 to 0",
        "x ~ uniform 0 - 1",
        "x ~ uniform 0 to e",
        "x ~ log_uniform 0 to 1",
        "x ~ log_normal 1 sigma -1",
        "x ~ times -1 in 0 to 9",
        "x ~ windows 3 to 1 of 1 to 2 in 0 to 100",
        "x ~ windows 1 to 3 of 5 to 40 in 0 to 100",
        "x ~ one_of ",
        "x",
    ],
)
def test_what_is_no_law_is_refused_in_a_sentence(text):
    with pytest.raises(PluginError, match="law"):
        law(text)
