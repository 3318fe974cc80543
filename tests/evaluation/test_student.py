"""Student's interval against scipy's."""

import math

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from jerkbench.evaluation.intervals import student_interval


@pytest.mark.parametrize("n", [2, 3, 12])
def test_the_interval_is_that_of_the_t_test(n):
    d = np.random.default_rng(n).normal(size=n)
    ends = ttest_1samp(d, 0).confidence_interval(0.9)
    assert student_interval(d, 0.9) == pytest.approx((ends.low, ends.high))


def test_one_value_has_none():
    assert all(map(math.isnan, student_interval(np.array([1.0]), 0.95)))
