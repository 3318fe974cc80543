"""Fixes that the filter does not get: left out, or kept for the reference."""

from dataclasses import dataclass, replace

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.disturbances.common import Phased, fixes_of, require_values, rows_of
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Reference, Velocity
from jerkbench.timeline import nanoseconds


@register("disturbance", "decimate_position")
@dataclass(frozen=True)
class DecimatePosition(Phased):
    """Only every n-th position fix reaches the filter; velocity and reference stay.

    Fix i = 0, 1, 2, ... is kept where i mod every = phase. The phases are the replicates: seed s has the phase
    s mod every.

    Attributes:
        every: n; 1 keeps all.
        phase: the same one for all seeds, below ``every``; None: seed mod every.
    """

    every: int = 4
    phase: int | None = None

    def __post_init__(self) -> None:
        """Check that phase and every fit."""
        require_values(self, ("every",), lambda n: n >= 1, "give 1 (all fixes) or more.")
        self.require_phase()

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the fixes of one phase."""
        position = recording.position
        if position is None:
            return recording
        kept = np.arange(len(position.t_s)) % self.every == self.phase_of(seed)
        return replace(recording, position=rows_of(position, kept))


SOURCE = "fixes of the same receiver, withheld from the filter"

SAME_RATE = 0.1
"""By what part the interval of a velocity may differ from the fixes' and still be of the same receiver's epochs."""


@register("disturbance", "withhold")
@dataclass(frozen=True)
class Withhold(Phased):
    """The filter gets every n-th GNSS epoch; the others become the reference.

    Epoch i = 0, 1, 2, ... goes to the filter where i mod every = phase. The phases are the replicates: seed s has
    the phase s mod every. An independent reference (a simulation's truth) stays as it is. Withheld fixes share the
    receiver with those that the filter gets, so that an error which both have is not seen.

    Where a receiver derives its velocity from its positions, the velocity of a withheld epoch would leak its
    position, so it is withheld too. Rows that have the same axes form a group; a group that comes at the rate of
    the fixes belongs to their epochs, its i-th row to epoch i (latencies move the times of a group, not its order).
    Where a group has another number of rows than there are fixes, a row belongs to the first fix not before it.
    A velocity at another rate is another sensor's (a wheel's) and stays.

    Attributes:
        every: n.
        phase: the same one for all seeds, below ``every``; None: seed mod every.
        velocity: whether the velocity of a withheld epoch is withheld too.
    """

    every: int = 4
    phase: int | None = None
    velocity: bool = True

    def __post_init__(self) -> None:
        """Check that phase and every fit."""
        require_values(self, ("every",), lambda n: n >= 2, "give 2 or more, or nothing is withheld.")
        self.require_phase()

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with one phase of its GNSS epochs, and the others as reference.

        Raises:
            RecordingError: it has no position.
        """
        position, velocity = fixes_of(recording, "so none can be withheld."), recording.velocity
        kept = np.arange(len(position.t_s)) % self.every == self.phase_of(seed)
        if velocity is not None and self.velocity:
            velocity = rows_of(velocity, _kept_velocity(velocity, position.t_s, kept))
        return replace(
            recording,
            position=rows_of(position, kept),
            velocity=velocity,
            reference=_reference(recording.reference, position, ~kept),
        )


def _kept_velocity(velocity: Velocity, fixes_t_s: FloatArray, kept: BoolArray) -> BoolArray:
    """Return (m,) whether each row of ``velocity`` belongs to a kept epoch, or to no epoch."""
    keep = np.ones(len(velocity.t_s), dtype=bool)
    axes = np.isfinite(velocity.mps) @ np.array([1, 2, 4])
    for group in np.unique(axes):
        rows = np.flatnonzero(axes == group)
        if _same_rate(velocity.t_s[rows], fixes_t_s):
            keep[rows] = kept[_epochs(velocity.t_s[rows], fixes_t_s)]
    return keep


def _same_rate(t_s: FloatArray, fixes_t_s: FloatArray) -> bool:
    if min(len(t_s), len(fixes_t_s)) < 2:
        return True  # too few to tell: withhold with the fixes rather than leak
    interval, fixes = np.median(np.diff(t_s)), np.median(np.diff(fixes_t_s))
    return bool(abs(interval - fixes) <= SAME_RATE * fixes)


def _epochs(t_s: FloatArray, fixes_t_s: FloatArray) -> IntArray:
    """Return the row of the fix that each row of the velocity belongs to."""
    if len(t_s) == len(fixes_t_s):
        return np.arange(len(t_s))
    return np.minimum(np.searchsorted(nanoseconds(fixes_t_s), nanoseconds(t_s)), len(fixes_t_s) - 1)


def _reference(reference: Reference, position: Position, withheld: BoolArray) -> Reference:
    """Make the withheld fixes the reference; they keep ``scored``, and more, where the old one has their stamps."""
    if reference.independent:
        return reference
    t_s = position.t_s[withheld]
    same = np.isin(nanoseconds(reference.t_s), nanoseconds(t_s))
    if reference.enu_m is not None and same.sum() == len(t_s):
        return rows_of(reference, same, source=SOURCE)
    return Reference(t_s, SOURCE, independent=False, enu_m=position.enu_m[withheld])
