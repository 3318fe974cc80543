"""The dependence of a velocity on the slope of its own positions."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Recording

LEAST_ROWS = 30
SHIFTS = range(-2, 3)
"""By so many rows a velocity may be older or younger than the slope that it was computed from."""


@dataclass(frozen=True)
class Dependence:
    """The share of the positions' noise in the noise of a velocity.

    Attributes:
        stream: "velocity, horizontal" or "velocity, up".
        correlation: of the fast changes of both: near 0 for noise of its own, 1 where one is computed from the other.
        rows: over how many.
    """

    stream: str
    correlation: float
    rows: int


def velocity_dependence(recording: Recording) -> list[Dependence]:
    """Return how an ENU velocity of as many rows as there are positions follows their slope; horizontal and up apart.

    With s_i = (p_i - p_i-1)/(t_i - t_i-1), and x''_i = x_i - (x_i-1 + x_i+1)/2, in which a vehicle's motion is small
    and noise is not::

        max over k from -2 to 2 of corr(s''_i, v''_i-k)
    """
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or velocity.frame != "enu":
        return []
    dependences = []
    for name, axes in (("velocity, horizontal", [0, 1]), ("velocity, up", [2])):
        rows = np.isfinite(velocity.mps[:, axes]).all(axis=1)
        whole = np.isfinite(position.enu_m).all(axis=1)
        if rows.sum() != len(position.t_s) or not whole.all() or rows.sum() < LEAST_ROWS:
            continue
        slope = np.diff(position.enu_m[:, axes], axis=0) / np.diff(position.t_s)[:, None]
        correlations = [_correlation(slope, np.roll(velocity.mps[rows][:, axes], k, axis=0)[1:]) for k in SHIFTS]
        dependences.append(Dependence(name, max(correlations), int(rows.sum())))
    return dependences


def _correlation(slope: FloatArray, velocity: FloatArray) -> float:
    edge = max(SHIFTS)  # rolled over the ends
    a, b = (_fast(x)[edge:-edge] for x in (slope, velocity))
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0 else 0.0


def _fast(x: FloatArray) -> FloatArray:
    return x[1:-1] - 0.5 * (x[2:] + x[:-2])
