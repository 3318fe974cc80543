"""How vectors lie in memory, and their exponentials."""

import math

import numpy as np

from jerkbench.arrays import WIDE, FloatMatrix, FloatVector
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import row, runs_in
from jerkbench.kinematic.arguments import RUN


def fill_exponentials(w: FloatVector, x: FloatMatrix, y: FloatMatrix) -> None:
    run = runs_in(w, RUN)
    for k in range(len(x)):
        row(y, k, run, "1")[0] = math.exp(row(x, k, run, "1")[0])


def test_exponentials_of_vectors_are_those_of_the_library_to_two_units_in_the_last_place():
    special = [-np.inf, np.inf, np.nan, 0.0, -0.0, -708.0, -708.5, -1e300, 709.7, 709.9, 1e300, 1e-300]
    random = np.random.default_rng(1)
    x = np.concatenate([special, random.uniform(-707.9, 709.7, 5000), random.normal(0.0, 1.0, 4988)])
    y = np.empty((len(x) // WIDE, WIDE))
    fill = compiled_loop(fill_exponentials, "exponentials", {"RUN": RUN})
    fill(aligned_zeros(RUN.sizes["length"]), x.reshape(-1, WIDE), y)
    with np.errstate(over="ignore"):
        wanted = np.exp(x)
    wanted[wanted < np.finfo(float).tiny] = 0.0
    np.testing.assert_allclose(y.ravel(), wanted, rtol=2.0 * np.finfo(float).eps)
