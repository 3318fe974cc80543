"""The covariance recursion of position and velocity behind noisy inputs, with measurement noise that may last."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray

FLAT_M, FLAT_MPS = 1e4, 1e3
"""One sigma of position and of velocity before anything was measured: nothing is known of them."""


class Noise(NamedTuple):
    """Noise of a measurement, one row an update.

    Attributes:
        white: (m, 3) variance of what is new each time; infinite: the axis was not measured.
        lasting: (m, 3) standard deviation of the Gauss-Markov process; 0: there is none.
        time_s: its correlation time.
    """

    white: FloatArray
    lasting: FloatArray
    time_s: float


@dataclass(frozen=True)
class Motion:
    """Four states an axis, each axis alike: position, velocity, and the lasting noise of each in its own sigmas.

    Attributes:
        dt_s: interval of the input.
        accel_sigma_mps2: one sigma of the white noise of an input.
        times_s: correlation times of the lasting noise of position and velocity.
    """

    dt_s: float
    accel_sigma_mps2: float
    times_s: tuple[float, float]

    def over(self, steps: int) -> tuple[FloatArray, FloatArray]:
        """Return A (4, 4) and Q (4, 4) of as many inputs."""
        t, A, Q = steps * self.dt_s, np.eye(4), np.zeros((4, 4))
        keep = np.exp(-t / np.array(self.times_s))
        A[0, 1] = t
        A[[2, 3], [2, 3]] = keep
        power = self.accel_sigma_mps2**2 * self.dt_s
        Q[0, 0] = self.grown(np.array(steps))
        Q[0, 1] = Q[1, 0] = power * t**2 / 2
        Q[1, 1] = power * t
        Q[[2, 3], [2, 3]] = 1 - keep**2
        return A, Q

    def grown(self, steps: IntArray) -> FloatArray:
        """Return the variance of the position that as many inputs bring; their sum, done: the squares of j + 1/2."""
        squares = steps**3 / 3 - steps / 12
        return np.asarray(self.accel_sigma_mps2**2 * self.dt_s**4 * squares)


def position_variances(motion: Motion, updates: IntArray, position: Noise, velocity: Noise, steps: int) -> FloatArray:
    """Return (steps + 1, 3): the variance of each axis's position after each input, and after the update there.

    Between updates P = A P A' + Q; at one, for position and then velocity, with h = [1, 0, l, 0] or [0, 1, 0, l]::

        P = P - P h' h P/(h P h' + r)

    It asks nothing of the measured values, for the recursion is linear; l is the sigma of the lasting noise.

    Args:
        motion: the model.
        updates: (m,) after how many inputs each update is, increasing.
        position: noise of position in each update.
        velocity: alike.
        steps: how many inputs there are.

    Source: Tichavsky, Muravchik and Nehorai, "Posterior Cramer-Rao bounds for discrete-time nonlinear filtering", IEEE
    Transactions on Signal Processing 46 (1998), doi:10.1109/78.668800: of a linear system it is Riccati's recursion.
    """
    variances = np.empty((steps + 1, 3))
    P = np.tile(np.diag([FLAT_M**2, FLAT_MPS**2, 1.0, 1.0]), (3, 1, 1))
    begin = 0
    for row, end in enumerate(updates.tolist()):
        P = _carried(variances, motion, P, begin, end)
        P = _updated(P, 0, position.white[row], position.lasting[row])
        P = _updated(P, 1, velocity.white[row], velocity.lasting[row])
        variances[end], begin = P[:, 0, 0], end
    _carried(variances, motion, P, begin, steps)
    return variances


def _carried(variances: FloatArray, motion: Motion, P: FloatArray, begin: int, end: int) -> FloatArray:
    """Return P after the inputs up to ``end``, and put the variances on the way into their places."""
    steps = np.arange(end - begin + 1)
    t_s = (steps * motion.dt_s)[:, None]
    ways = P[:, 0, 0] + 2 * t_s * P[:, 0, 1] + t_s**2 * P[:, 1, 1]
    variances[begin : end + 1] = ways + motion.grown(steps)[:, None]
    A, Q = motion.over(end - begin)
    return np.asarray(A @ P @ A.T + Q)


def _updated(P: FloatArray, state: int, white: FloatArray, lasting: FloatArray) -> FloatArray:
    """Return P (3, 4, 4) after a scalar measurement of each axis."""
    gathered = P[:, :, state] + lasting[:, None] * P[:, :, state + 2]
    S = gathered[:, state] + lasting * gathered[:, state + 2] + white
    return np.asarray(P - gathered[:, :, None] * gathered[:, None, :] / S[:, None, None])
