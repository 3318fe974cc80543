"""Errors that last: with a state for them a filter knows how large its errors are; without, by how much it does not."""

import numpy as np
import pytest
from scipy.stats import chi2
from slow_errors_filter import squares

from jerkbench.datasets.field import Field

TIMES_S = (15.0, 35.0, 55.0)
"""Apart by four times the longest correlation of an error."""


def mean_and_band(seeds, **how):
    values = np.concatenate([squares(Field(duration_s=60.0), seed, TIMES_S, **how) for seed in range(seeds)])
    low, high = chi2.ppf([0.025, 0.975], 6 * len(values)) / len(values)
    return values.mean(), low, high


@pytest.mark.slow
def test_with_the_slow_errors_modelled_nees_lies_in_its_band():
    mean, low, high = mean_and_band(40)
    assert low < mean < high


def test_without_them_it_is_far_above():
    mean, _, high = mean_and_band(4, modelled=False)
    assert mean > 5 * high
