"""Models of many lengths of a step at once are those of each length, as the equations have them."""

import numpy as np
import pytest

from jerkbench.contracts import axis_models
from jerkbench.plugins import create

DT0 = 0.01
LENGTHS = [1e-9, 0.0007, 0.01, 0.0123, 0.5]

EQUATIONS = {
    "baseline": lambda h: ([[1, h], [0, 1]], [h * h / 2, h], [0.2**2, 0]),
    "jerk": lambda h: ([[1, h, h**3 / 6], [0, 1, h * h / 2], [0, 0, 1]], [h * h / 2, h, 0], [0.1**2, 6.0**2]),
    "bias": lambda h: ([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]], [h * h / 2, h, 0], [0.1**2, 0.03**2]),
}


@pytest.mark.parametrize("name", EQUATIONS)
def test_each_is_what_the_equations_say(name):
    A, b, Q = axis_models(create("filter", {"name": name}), np.array([0.0, *LENGTHS]), DT0)

    assert (A[0] == np.eye(len(A[0]))).all()
    assert not b[0].any()
    for row, h in enumerate(LENGTHS, start=1):
        expected_A, expected_b, (accel, walk) = EQUATIONS[name](h)
        expected_Q = [[accel * DT0 / h * x * y for y in expected_b] for x in expected_b]
        expected_Q[-1][-1] += walk * h
        np.testing.assert_allclose(A[row], expected_A, rtol=1e-14)
        np.testing.assert_allclose(b[row], expected_b, rtol=1e-14)
        np.testing.assert_allclose(Q[row], expected_Q, rtol=1e-13)
