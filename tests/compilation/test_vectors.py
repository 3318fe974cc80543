"""How vectors lie in memory, and their exponentials."""

import math

import numpy as np
from numba.core.registry import cpu_target

from jerkbench.arrays import WIDE, FloatMatrix, FloatVector
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import aligned_zeros, vector_of
from jerkbench.compilation.views import row, runs_in
from jerkbench.kinematic.arguments import RUN


def test_a_vector_may_begin_at_any_number_of_an_array():
    """LLVM's own vector of 8 numbers begins at 64 bytes, numba's arrays at 32: on wide registers that is a crash."""
    kind, target = vector_of(WIDE), cpu_target.target_context
    stored = target.data_model_manager[kind].get_data_type()
    assert target.get_abi_alignment(stored) <= 8
    assert target.get_abi_sizeof(stored) == 8 * WIDE
    assert target.get_abi_alignment(target.get_value_type(kind)) == 8 * WIDE


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
