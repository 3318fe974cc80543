"""The memory of an adaptation: a vector, which it need not have."""

from typing import Protocol, runtime_checkable

import numpy as np

from jerkbench.arrays import FloatArray


@runtime_checkable
class Remembering(Protocol):
    """What an adaptation offers that remembers something from one update to the next."""

    def memory_size(self) -> int:
        """Return the length of the memory that `adapt` gets."""
        ...


def empty_memory(adaptation: object) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run: zeros, none where it does not remember anything."""
    return np.zeros(adaptation.memory_size() if isinstance(adaptation, Remembering) else 0)
