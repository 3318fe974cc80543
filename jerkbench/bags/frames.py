"""The frame of a twist, body or world, and its independence from its own positions."""

from collections.abc import Iterator

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_quaternion
from jerkbench.readers.ros.messages import Messages
from jerkbench.sanitiser.values import unit_quaternions

TELLS = 0.7
"""One reading has to fit so much better than the other to be believed."""

SLOPE_MPS = 0.01
"""A velocity that differs less (rms) from the slope of the positions was computed from them."""

MOVES_MPS = 0.1
"""Slower than that nothing can be told apart."""


def twist_frame(messages: Messages) -> Iterator[str]:
    """Yield in which frame the velocity fits the slope of the positions: as it is, or turned by the orientation."""
    rows = unit_quaternions(messages["orientation"]) & np.isfinite(messages["linear"]).all(axis=1)
    t_s = (messages.stamp_ns[rows] - messages.stamp_ns[0]) * 1e-9
    keep = np.concatenate([[True], np.diff(t_s) > 0])[: len(t_s)]
    t_s, position, linear = t_s[keep], messages["position"][rows][keep], messages["linear"][rows][keep]
    if len(t_s) < 5 or np.sqrt((linear**2).sum(axis=1).mean()) < MOVES_MPS:
        return
    slope, middle = np.diff(position, axis=0) / np.diff(t_s)[:, None], 0.5 * (linear[1:] + linear[:-1])
    turned = np.einsum("nij,nj->ni", dcm_from_quaternion(messages["orientation"][rows][keep][1:]), middle)
    world, body = _misfit(middle - slope), _misfit(turned - slope)
    misfit = f"(misfit to the slope of the positions {min(world, body):.3f}, else {max(world, body):.3f} m/s)"
    if min(world, body) < TELLS * max(world, body):
        yield f"its velocity is in the {'world' if world < body else 'body'}'s frame {misfit}"
    if min(world, body) < SLOPE_MPS:
        yield "its velocity is the slope of its positions: not independent of them"


def _misfit(difference_mps: FloatArray) -> float:
    """Median length: a leap of the positions shall not decide."""
    return float(np.median(np.linalg.norm(difference_mps, axis=1)))
