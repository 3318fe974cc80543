"""Curves over time: thinned to what a pixel shows; those that coincide are said to."""

import itertools

import numpy as np

from jerkbench.report.plots.style import thinned

T_S = 0.01 * np.arange(50_000)


def columns_of(t_s, values, columns=1000):
    """The lowest and the highest value of each column of pixels, by a loop."""
    edges = np.linspace(T_S[0], T_S[-1], columns + 1)
    parts = [values[(t_s >= low) & (t_s < high)] for low, high in itertools.pairwise(edges)]
    return [(part.min(), part.max()) for part in parts]


def test_what_a_column_of_pixels_shows_stays_and_little_else():
    values = np.random.default_rng(1).normal(size=len(T_S)) * np.sin(T_S / 50)
    t_s, kept = thinned(T_S, values)
    assert len(t_s) <= 2002
    assert columns_of(t_s, kept) == columns_of(T_S, values)
    assert (t_s[0], t_s[-1]) == (T_S[0], T_S[-1])


def test_a_gap_stays_a_gap():
    values = np.ones(len(T_S))
    values[20_000:30_000] = np.nan
    t_s, kept = thinned(T_S, values)
    (gap,) = np.flatnonzero(np.isnan(kept))
    assert kept[gap - 1] == kept[gap + 1] == 1.0
    assert t_s[gap - 1] <= T_S[19_999] < t_s[gap + 1]
    assert t_s[gap + 1] >= T_S[30_000]
