"""Gravity and the Earth's rotation in a local tangent plane."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2, Origin

RATE_RADPS = 7.292115e-5
"""The Earth's rate (WGS-84)."""

RADIUS_M = 6_371_000.0
"""Mean radius: that of the ellipsoid differs by .3 %, which turns gravity by 1e-6 rad over 2 km."""


class Earth(NamedTuple):
    """What the navigation equations know of the Earth.

    Attributes:
        rotates: whether it turns.
        rate_radps: (3,) the Earth's rate in ENU at the origin.
        per_radius: 1/R [1/m]; 0: gravity is the same everywhere.
    """

    rotates: bool
    rate_radps: FloatArray
    per_radius: float


FLAT = Earth(rotates=False, rate_radps=np.zeros(3), per_radius=0.0)
"""A plane that does not turn, with gravity straight down."""


def earth_at(origin: Origin | None, *, rotates: bool, curved: bool) -> Earth:
    """Return the Earth at ``origin``; without a known origin it does not turn."""
    if not rotates or origin is None:
        return FLAT._replace(per_radius=1.0 / RADIUS_M if curved else 0.0)
    latitude = np.deg2rad(origin.latitude_deg)
    rate = RATE_RADPS * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    return Earth(rotates=True, rate_radps=rate, per_radius=1.0 / RADIUS_M if curved else 0.0)


STRAIGHT_DOWN = np.array([0.0, 0.0, -GRAVITY_MPS2])
STRAIGHT_DOWN.flags.writeable = False


def gravity_enu(position_m: FloatArray, per_radius: float) -> FloatArray:
    """Return g(p) = -g [e/R, n/R, 1 - 2 u/R]: in the tangent plane it points to the Earth's centre."""
    if per_radius == 0.0:
        return STRAIGHT_DOWN
    e, n, u = position_m.tolist()
    g = GRAVITY_MPS2
    return np.array([-g * e * per_radius, -g * n * per_radius, -g * (1.0 - 2.0 * u * per_radius)])
