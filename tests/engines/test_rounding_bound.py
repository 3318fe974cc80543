"""The bound by which the kernel knows that nothing of an update is rounding, over correlations of any strength."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jerkbench.kalman import EXPOSED
from jerkbench.kinematic.update import BOUND


@st.composite
def correlations(draw):
    """Of two to six rows, from none to nearly singular; or all against each other, which comes nearest to the bound."""
    rows, share = draw(st.integers(2, 6)), 10.0 ** draw(st.floats(-4.0, 0.0))
    if draw(st.booleans()):
        return np.eye(rows) - (1.0 - share) * (np.ones((rows, rows)) - np.eye(rows)) / (rows - 1)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    half = np.sqrt(share) * rng.normal(size=(rows, 2 * rows)) + rng.normal(size=(1, 2 * rows))
    S = half @ half.T
    sigma = np.sqrt(np.diag(S))
    return S / np.outer(sigma, sigma)


@given(correlations())
def test_what_is_left_at_the_bound_is_more_than_the_share_that_counts_as_rounding(C):
    """Of a variance of one all but ``left`` is taken away, by the gain that is largest for its rows."""
    eigenvalues, directions = np.linalg.eigh(C)
    left = BOUND / np.prod(eigenvalues)
    if left < 1.0:
        Z = directions[:, 0] * np.sqrt((1.0 - left) / eigenvalues[0])  # of rows with S_ii = 1
        assert Z @ C @ Z + left == pytest.approx(1.0)
        assert left > EXPOSED * (1.0 + Z @ Z)
