"""The path of the robot: passes to and fro over the field, with headland turns between them."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.simulation.smooth import smoothstep, smoothstep_area


@dataclass(frozen=True)
class Path:
    """Boustrophedon: stand, ramp up, then straight passes and turns of 180 degrees to alternating sides.

    The speed is a sum of smoothsteps S, one for each change; in a turn of length T that starts at t_0 the yaw rate is

        (pi/T) (1 - cos(2 pi (t - t_0)/T)),  left at first, then right, left, ...

    A pass ends and the next one begins with the change between the two speeds, so that a turn is driven at
    ``turn_speed_mps`` from its first to its last moment.

    Attributes:
        stand_s: how long it stands at the start.
        ramp_s: how long it takes to reach the speed of a pass.
        pass_s: length of a pass, speed changes included.
        turn_s: length T of a turn.
        speed_mps: horizontal speed on a pass.
        turn_speed_mps: horizontal speed in a turn.
        speed_change_s: how long it takes from one speed to the other.
        heading_rad: first heading, from east towards north.
    """

    stand_s: float
    ramp_s: float
    pass_s: float
    turn_s: float
    speed_mps: float
    turn_speed_mps: float
    speed_change_s: float
    heading_rad: float

    def turn_starts_s(self, until_s: float) -> FloatArray:
        """Times before ``until_s`` at which a turn begins."""
        first, period = self.stand_s + self.ramp_s + self.pass_s, self.pass_s + self.turn_s
        return first + period * np.arange(max(0, int(np.ceil((until_s - first) / period))), dtype=float)

    def speed_mps_at(self, t_s: FloatArray) -> FloatArray:
        """Horizontal speed (n,) at increasing times (n,)."""
        speed = np.zeros_like(t_s)
        for start, length, change in self._speed_changes(t_s):
            speed += change * smoothstep((t_s - start) / length)
        return speed

    def distance_m_at(self, t_s: FloatArray) -> FloatArray:
        """Horizontal distance (n,) driven since the start."""
        distance = np.zeros_like(t_s)
        for start, length, change in self._speed_changes(t_s):
            distance += change * length * smoothstep_area((t_s - start) / length)
        return distance

    def yaw_rad_at(self, t_s: FloatArray) -> FloatArray:
        """Yaw (n,), not wrapped; each turn adds +-(pi w - sin(2 pi w)/2) with w = (t - t_0)/T in [0, 1]."""
        yaw = np.full_like(t_s, self.heading_rad)
        for number, start in enumerate(self.turn_starts_s(t_s[-1])):
            w = np.clip((t_s - start) / self.turn_s, 0.0, 1.0)
            yaw += (-1) ** number * (np.pi * w - 0.5 * np.sin(2.0 * np.pi * w))
        return yaw

    def _speed_changes(self, t_s: FloatArray) -> list[tuple[float, float, float]]:
        """Start, length and size of each change of speed."""
        changes = [(self.stand_s, self.ramp_s, self.speed_mps)]
        slower = self.turn_speed_mps - self.speed_mps
        for start in self.turn_starts_s(t_s[-1] + self.speed_change_s):
            changes.append((float(start) - self.speed_change_s, self.speed_change_s, slower))
            changes.append((float(start) + self.turn_s, self.speed_change_s, -slower))
        return changes
