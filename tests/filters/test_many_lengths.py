"""Models of many lengths of a step at once are those of each length, as the equations have them."""

import math

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


@pytest.mark.parametrize("name", [*EQUATIONS, "acceleration"])
def test_one_length_is_one_of_many_and_asked_for_once(name, monkeypatch):
    model = create("filter", {"name": name})
    many = axis_models(model, np.array(LENGTHS), DT0)
    one_by_one = [model.axis_model(h, DT0) for h in LENGTHS]

    assert hasattr(model, "axis_models")
    for k in range(3):
        np.testing.assert_array_equal(many[k], np.stack([one[k] for one in one_by_one]))
    monkeypatch.setattr(type(model), "axis_model", lambda *_: pytest.fail("asked one by one"))
    axis_models(model, np.array(LENGTHS), DT0)


def test_a_filter_that_has_one_length_only_is_asked_one_by_one():
    class Plain:
        def axis_model(self, dt, dt0):
            return np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt, math.sqrt(dt)]), dt0 * np.eye(2)

        def initial_variances(self):
            return np.zeros(0)

    A, b, _ = axis_models(Plain(), np.array([0.0, 0.25]), DT0)
    assert A[1, 0, 1] == 0.25
    assert b.tolist() == [[0.0, 0.0], [0.25, 0.5]]
