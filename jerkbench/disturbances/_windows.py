"""Intervals of time, each with its begin inside and its end outside."""

from itertools import pairwise

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import PluginError

Windows = tuple[tuple[float, ...], ...]


def require_windows(windows_s: Windows, subject: str) -> None:
    """Raise a PluginError unless each window is a begin and a later end; ``subject`` is what it should be."""
    for window in windows_s:
        if len(window) != 2 or not window[0] < window[1]:
            raise PluginError(f"The window {window} is no {subject}; give a begin and a later end, in seconds.")


def require_apart(windows_s: Windows, subject: str) -> None:
    """Raise a PluginError where two windows overlap."""
    for window, later in pairwise(sorted(windows_s)):
        if window[1] > later[0]:
            raise PluginError(f"The windows {window} and {later} overlap; give each {subject} a window of its own.")


def as_array(windows_s: Windows) -> FloatArray:
    """Return (k, 2) begins and ends."""
    return np.array(windows_s, dtype=np.float64).reshape(-1, 2)


def in_any(t_s: FloatArray, windows_s: FloatArray) -> BoolArray:
    """Return (m,) whether a time lies in any of the windows (k, 2): begin <= t < end."""
    begin, end = windows_s.T
    inside: BoolArray = ((t_s[:, None] >= begin) & (t_s[:, None] < end)).any(axis=1)
    return inside
