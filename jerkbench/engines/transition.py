"""The transition from one update to the next: F and Q of all steps in between."""

import numpy as np

from jerkbench.arrays import FloatArray


class Transition:
    """F and Q since the last update, so that P- = F P+ F' + Q with its posterior P+.

    Attributes:
        F: (n, n) product of the transitions.
        Q: (n, n) process noise that has gathered.
    """

    def __init__(self, states: int) -> None:
        """Begin at an update of a filter with ``states`` states."""
        self.F, self.Q = np.eye(states), np.zeros((states, states))

    def add(self, F: FloatArray, Q: FloatArray) -> None:
        """Go one step on."""
        self.F, self.Q = F @ self.F, F @ self.Q @ F.T + Q
