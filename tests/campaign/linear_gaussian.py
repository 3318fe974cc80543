"""A recording that is exactly what the baseline filter assumes: sigma_a and R are known."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.estimate import Attitude
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity
from synthetic import level_attitude

SIGMA_A, R_POSITION, R_VELOCITY = 0.5, 4.0, 0.25
"""The truth: the noise of a sample [m/s2], and what the reported covariances have to be multiplied by."""
REPORTED_M, REPORTED_MPS = 0.05, 0.2


@dataclass(frozen=True)
class LinearGaussian:
    """A body that is shaken by white noise of which the IMU sees nothing; its covariances are reported wrongly."""

    seeded: ClassVar[bool] = True
    duration_s: float = 60.0

    def fingerprint(self):
        return ""

    def load(self, seed):
        rng = np.random.default_rng(seed)
        dt, n = 0.02, round(self.duration_s / 0.02)
        t = dt * np.arange(1, n + 1)
        a = SIGMA_A * rng.standard_normal((n, 3))
        v = np.cumsum(a * dt, axis=0)
        p = np.cumsum(v * dt - 0.5 * a * dt**2, axis=0)
        fixes = np.arange(9, n, 10)
        z_p = p[fixes] + REPORTED_M * np.sqrt(R_POSITION) * rng.standard_normal((len(fixes), 3))
        z_v = v[fixes] + REPORTED_MPS * np.sqrt(R_VELOCITY) * rng.standard_normal((len(fixes), 3))
        R_p, R_v = (np.tile(s**2 * np.eye(3), (len(fixes), 1, 1)) for s in (REPORTED_M, REPORTED_MPS))
        level = np.tile([0.0, 0.0, 9.81], (n, 1))
        return Recording(
            name="linear-Gaussian",
            imu=Imu(t, level, np.zeros_like(level)),
            position=Position(t[fixes], z_p, R_p),
            velocity=Velocity(t[fixes], z_v, R_v),
            reference=Reference(t[::10], "simulated", independent=True, enu_m=p[::10], velocity_mps=v[::10]),
        )


@dataclass(frozen=True)
class Level:
    """A level attitude; nothing is to be estimated."""

    def estimate(self, recording) -> Attitude:
        return level_attitude(recording)
