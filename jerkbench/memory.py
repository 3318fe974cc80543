"""The memory of an adaptation: a vector, which it need not have."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Remembering


def empty_memory(adaptation: object) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run: zeros, none where it does not remember anything."""
    return np.zeros(adaptation.memory_size() if isinstance(adaptation, Remembering) else 0)
