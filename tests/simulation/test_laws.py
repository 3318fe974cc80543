import numpy as np
import pytest
from scipy import stats

from jerkbench.datasets.random_drive import parse_distribution
from jerkbench.errors import PluginError


def draws(text, count=4000):
    """Values of a distribution, drawn from one generator."""
    random = np.random.default_rng(20260101)
    return [parse_distribution(text).draw(random, {}) for _ in range(count)]


def test_a_value_may_be_constant_or_depend_on_another():
    assert parse_distribution("duration_s ~ always 60").draw(np.random.default_rng(0), {}) == 60.0
    assert parse_distribution("gyro = accel * 0.025").draw(np.random.default_rng(0), {"accel": 0.2}) == 0.025 * 0.2
    assert parse_distribution("force = drop * 20 12 30").draw(np.random.default_rng(0), {"drop": 0.1}) == (
        2.0,
        12 * 0.1,
        3.0,
    )


def test_choices_and_sorted_times_are_equally_likely():
    choices, counts = np.unique(draws("trace ~ one_of a b c"), return_counts=True)
    assert list(choices) == ["a", "b", "c"]
    assert stats.chisquare(counts).pvalue > 0.01
    times = np.array(draws("t ~ times 2 in 15 to 145"))
    assert (times[:, 0] <= times[:, 1]).all()
    assert stats.kstest(times.ravel(), stats.uniform(15, 130).cdf).pvalue > 0.01


def test_windows_are_uniform_in_number_length_and_time_and_do_not_overlap():
    drawn = draws("w ~ windows 1 to 3 of 2 to 10 in 15 to 145")
    counts = np.bincount([len(windows) for windows in drawn], minlength=4)
    lengths = [end - begin for windows in drawn for begin, end in windows]
    single = np.array([windows[0] for windows in drawn if len(windows) == 1])

    assert counts[0] == 0
    assert stats.chisquare(counts[1:]).pvalue > 0.01
    assert stats.kstest(lengths, stats.uniform(2, 8).cdf).pvalue > 0.01
    share = (single[:, 0] - 15) / (130 - np.diff(single)[:, 0])
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
def test_an_invalid_distribution_raises(text):
    with pytest.raises(PluginError, match="distribution"):
        parse_distribution(text)
