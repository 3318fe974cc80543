"""The memory of an adaptation: a vector, which it need not have."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Remembering, RememberingStates, has_methods

MEASURED = 6
"""States of position and velocity, which every filter has."""


def empty_memory(adaptation: object, states: int = MEASURED) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run over a filter of ``states`` states.

    It is zero, and of no length where the adaptation does not remember anything.
    """
    return np.zeros(memory_size(adaptation, states))


def memory_size(adaptation: object, states: int) -> int:
    """Return how many numbers ``adaptation`` remembers over a filter of ``states`` states."""
    if has_methods(adaptation, RememberingStates):
        return adaptation.memory_size_of(states)
    return adaptation.memory_size() if has_methods(adaptation, Remembering) else 0
