"""Ruts: the robot drops, is thrown and slowed, and its accelerometer feels more than it moves."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray


@dataclass(frozen=True)
class Ruts:
    """At each time t_r the robot drops into a rut and drives on at the lower level.

    With u = (t - t_r)/tau, the step H(u) = (1 + tanh u)/2 and the pulse B(u) = 1 - tanh^2 u::

        height -= drop H;  speed -= dip B;  pitch += pitch_0 B;  roll += roll_0 B
        distance -= dip tau (1 + tanh u)

    Attributes:
        times_s: t_r; empty: no rut.
        drop_m: how deep.
        tau_s: tau, how quickly.
        speed_dip_mps: dip.
        pitch_rad: pitch_0, nose down.
        roll_rad: roll_0, right side down.
    """

    times_s: tuple[float, ...]
    drop_m: float
    tau_s: float
    speed_dip_mps: float
    pitch_rad: float
    roll_rad: float

    def pulse(self, t_s: FloatArray) -> FloatArray:
        """Sum of B (n,) over the ruts."""
        return np.asarray(sum((1.0 - np.tanh((t_s - t) / self.tau_s) ** 2 for t in self.times_s), np.zeros_like(t_s)))

    def steps(self, t_s: FloatArray) -> FloatArray:
        """Sum of H (n,): how many ruts it has dropped into."""
        return np.asarray(
            sum((0.5 * (1.0 + np.tanh((t_s - t) / self.tau_s)) for t in self.times_s), np.zeros_like(t_s))
        )
