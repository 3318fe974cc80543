"""The memory of an adaptation: a vector, which it need not have."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Remembering, RememberingStates

MEASURED = 6
"""States of position and velocity, which every filter has."""


def empty_memory(adaptation: object, states: int = MEASURED) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run over a filter of ``states`` states.

    It is zero, and of no length where the adaptation does not remember anything.
    """
    if isinstance(adaptation, RememberingStates):
        return np.zeros(adaptation.memory_size_of(states))
    return np.zeros(adaptation.memory_size() if isinstance(adaptation, Remembering) else 0)
