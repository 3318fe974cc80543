"""Errors that count while the vehicle moves, so many times a second."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.disturbances.common import Once, fixes_of
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference

HALF_S = 0.5
"""The speed is the reference's mean over a second."""

SPEED_GAP_S = 1.5
"""In a longer gap of the reference no speed is known."""


@register("disturbance", "score_moving")
@dataclass(frozen=True)
class ScoreMoving(Once):
    """Errors count only where the reference moves, at most once in 1/``rate_hz`` seconds; nothing else changes.

    A recording that stands still for half of its time would mostly say how well a filter stands still, and a reference
    of 100 Hz would count a hundred times as much as one of 1 Hz. The horizontal speed is that of the reference over a
    second, |p(t + .5 s) - p(t - .5 s)|/1 s, linear between its stamps; where it has a gap of more than 1.5 s, nothing
    counts. Of each interval of 1/``rate_hz`` the first stamp that moves counts.

    Attributes:
        rate_hz: how often errors count.
        slowest_mps: slower is standing still.
        fix_s: errors count only where a fix is at most so far away in time; 0: in gaps of the fixes, too.
    """

    seeded: ClassVar[bool] = False

    rate_hz: float = 1.0
    slowest_mps: float = 0.5
    fix_s: float = 0.0

    def __post_init__(self) -> None:
        """Check that the rate is one, and that nothing is negative."""
        if not 0 < self.rate_hz < np.inf:
            raise PluginError(f"rate_hz is {self.rate_hz}; it must be positive.")
        for name in ("slowest_mps", "fix_s"):
            if not 0 <= getattr(self, name) < np.inf:
                raise PluginError(f"{name} is {getattr(self, name)}; it must be 0 or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with fewer stamps of its reference scored; ``seed`` changes nothing.

        Raises:
            RecordingError: its reference has no positions, or it has no fixes where ``fix_s`` asks for them.
        """
        reference = recording.reference
        counts = reference.scored & (horizontal_speed(reference, recording.name) > self.slowest_mps)
        if self.fix_s:
            fix_s = fixes_of(recording, "so none is near.").t_s
            after = np.clip(np.searchsorted(fix_s, reference.t_s), 1, len(fix_s) - 1)
            away_s = np.minimum(np.abs(fix_s[after] - reference.t_s), np.abs(fix_s[after - 1] - reference.t_s))
            counts &= away_s <= self.fix_s
        return replace(recording, reference=replace(reference, scored=self._thinned(reference.t_s, counts)))

    def _thinned(self, t_s: FloatArray, counts: BoolArray) -> BoolArray:
        """Return (k,) the first stamp of each interval that ``counts``."""
        places = np.flatnonzero(counts)
        _, first = np.unique(np.floor(t_s[places] * self.rate_hz + 1e-6), return_index=True)
        thinned = np.zeros(len(t_s), dtype=np.bool_)
        thinned[places[first]] = True
        return thinned


def horizontal_speed(reference: Reference, name: str) -> FloatArray:
    """Return (k,) the horizontal speed over a second at each stamp [m/s]; NaN where it is not known.

    Raises:
        RecordingError: the reference of the recording ``name`` has no two places.
    """
    places = reference.enu_m
    known = np.isfinite(places).all(axis=1) if places is not None else np.zeros(0, dtype=np.bool_)
    if places is None or known.sum() < 2:
        raise RecordingError(f"The reference of {name} has no positions, so that no speed is known.")
    own_s, own_m = reference.t_s[known], places[known]
    moved = np.zeros((len(reference.t_s), 2))
    inside = np.ones(len(reference.t_s), dtype=np.bool_)
    for sign in (1.0, -1.0):
        t_s = reference.t_s + sign * HALF_S
        after = np.clip(np.searchsorted(own_s, t_s), 1, len(own_s) - 1)
        inside &= (t_s >= own_s[0]) & (t_s <= own_s[-1]) & (own_s[after] - own_s[after - 1] <= SPEED_GAP_S)
        moved += sign * np.column_stack([np.interp(t_s, own_s, own_m[:, axis]) for axis in (0, 1)])
    return np.where(inside, np.hypot(*moved.T) / (2.0 * HALF_S), np.nan)
