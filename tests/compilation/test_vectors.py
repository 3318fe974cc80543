"""How vectors lie in memory."""

from numba.core.registry import cpu_target

from jerkbench.arrays import WIDE
from jerkbench.compilation.vectors import vector_of


def test_a_vector_may_begin_at_any_number_of_an_array():
    """LLVM's own vector of 8 numbers begins at 64 bytes, numba's arrays at 32: on wide registers that is a crash."""
    kind, target = vector_of(WIDE), cpu_target.target_context
    stored = target.data_model_manager[kind].get_data_type()
    assert target.get_abi_alignment(stored) <= 8
    assert target.get_abi_sizeof(stored) == 8 * WIDE
    assert target.get_abi_alignment(target.get_value_type(kind)) == 8 * WIDE
