"""Smooth steps, so that speed and height can be differentiated twice."""

import numpy as np

from jerkbench.arrays import FloatArray


def smoothstep(u: FloatArray) -> FloatArray:
    """S(u) = 10 u^3 - 15 u^4 + 6 u^5 from 0 to 1 over 0 <= u <= 1; its first two derivatives vanish at both ends."""
    w = np.clip(u, 0.0, 1.0)
    step: FloatArray = w**3 * (10.0 + w * (6.0 * w - 15.0))
    return step


def smoothstep_rate(u: FloatArray) -> FloatArray:
    """dS/du = 30 u^2 (1 - u)^2."""
    w = np.clip(u, 0.0, 1.0)
    rate: FloatArray = 30.0 * (w * (1.0 - w)) ** 2
    return rate


def smoothstep_area(u: FloatArray) -> FloatArray:
    """Integral of S from 0 to u: u^4 (u^2 - 3 u + 5/2) up to u = 1, and u - 1/2 beyond."""
    w = np.clip(u, 0.0, 1.0)
    area: FloatArray = (w * w) ** 2 * (w * (w - 3.0) + 2.5) + np.maximum(u - 1.0, 0.0)
    return area
