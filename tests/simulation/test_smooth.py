import numpy as np
from scipy.integrate import quad
from scipy.interpolate import BPoly

from jerkbench.simulation.motion import smoothstep, smoothstep_area, smoothstep_rate

U = np.array([-1.0, 0.0, 0.1, 0.37, 0.5, 0.99, 1.0, 2.5])
# the one quintic whose value goes from 0 to 1 while two derivatives vanish at both ends
HERMITE = BPoly.from_derivatives([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


def expected(u):
    return float(HERMITE(min(max(u, 0.0), 1.0)))


def test_step_is_the_quintic_hermite_polynomial():
    np.testing.assert_allclose(smoothstep(U), [expected(u) for u in U], atol=1e-14)


def test_rate_is_its_derivative():
    inside = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(smoothstep_rate(inside), HERMITE.derivative()(inside), atol=1e-13)
    assert smoothstep_rate(np.array([-0.5, 1.5])).tolist() == [0.0, 0.0]


def test_area_is_its_integral():
    areas = [quad(expected, 0.0, u, points=[1.0] if u > 1 else None)[0] for u in U]
    np.testing.assert_allclose(smoothstep_area(U), areas, atol=1e-12)
