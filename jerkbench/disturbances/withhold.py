"""What the filter gets, and what is scored: fixes left out, or kept for the reference; errors that count in motion."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, linear_at, nearest_rows
from jerkbench.disturbances.common import Once, Phased, fixes_of, rows_of
from jerkbench.errors import RecordingError
from jerkbench.parameters import Limit
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

    every: Annotated[int, Limit(lambda n: n >= 1, "give 1 (all fixes) or more.")] = 4
    phase: int | None = None

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the fixes of one phase."""
        position = recording.position
        if position is None:
            return recording
        kept = np.arange(len(position.t_s)) % self.every == self.phase_of(seed)
        return replace(recording, position=rows_of(position, kept))


_SOURCE = "fixes of the same receiver, withheld from the filter"

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

    every: Annotated[int, Limit(lambda n: n >= 2, "give 2 or more, or nothing is withheld.")] = 4
    phase: int | None = None
    velocity: bool = True

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
            epochs = np.arange(len(rows))
            if len(rows) != len(fixes_t_s):  # a row belongs to the first fix not before it
                epochs = np.searchsorted(nanoseconds(fixes_t_s), nanoseconds(velocity.t_s[rows]))
            keep[rows] = kept[np.minimum(epochs, len(fixes_t_s) - 1)]
    return keep


def _same_rate(t_s: FloatArray, fixes_t_s: FloatArray) -> bool:
    if min(len(t_s), len(fixes_t_s)) < 2:
        return True  # too few to tell: withhold with the fixes rather than leak
    interval, fixes = np.median(np.diff(t_s)), np.median(np.diff(fixes_t_s))
    return bool(abs(interval - fixes) <= SAME_RATE * fixes)


def _reference(reference: Reference, position: Position, withheld: BoolArray) -> Reference:
    """Make the withheld fixes the reference; they keep ``scored``, and more, where the old one has their stamps."""
    if reference.independent:
        return reference
    t_s = position.t_s[withheld]
    same = np.isin(nanoseconds(reference.t_s), nanoseconds(t_s))
    if reference.enu_m is not None and same.sum() == len(t_s):
        return rows_of(reference, same, source=_SOURCE)
    return Reference(t_s, _SOURCE, independent=False, enu_m=position.enu_m[withheld])


# Errors that count while the vehicle moves, so many times a second.

HALF_S = 0.5
"""The speed is the reference's mean over a second."""

NOT_BELOW_0 = Limit(lambda value: 0 <= value < np.inf, "it must be 0 or more.")

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

    rate_hz: Annotated[float, Limit(lambda rate: 0 < rate < np.inf, "it must be positive.")] = 1.0
    slowest_mps: Annotated[float, NOT_BELOW_0] = 0.5
    fix_s: Annotated[float, NOT_BELOW_0] = 0.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with fewer stamps of its reference scored; ``seed`` changes nothing.

        Raises:
            RecordingError: its reference has no positions, or it has no fixes where ``fix_s`` asks for them.
        """
        reference = recording.reference
        counts = reference.scored & (horizontal_speed(reference, recording.name) > self.slowest_mps)
        if self.fix_s:
            fix_s = fixes_of(recording, "so none is near.").t_s
            counts &= np.abs(fix_s[nearest_rows(fix_s, reference.t_s)] - reference.t_s) <= self.fix_s
        return replace(recording, reference=replace(reference, scored=self._thinned(reference.t_s, counts)))

    def _thinned(self, t_s: FloatArray, counts: BoolArray) -> BoolArray:
        """Return (k,) the first stamp of each interval that ``counts``."""
        places = np.flatnonzero(counts)
        _, first = np.unique(np.floor(t_s[places] * self.rate_hz + 1e-6), return_index=True)
        return np.isin(np.arange(len(t_s)), places[first])


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
    late, early = (linear_at(own_s, own_m[:, :2], reference.t_s + shift, SPEED_GAP_S) for shift in (HALF_S, -HALF_S))
    return np.asarray(np.hypot(*(late - early).T) / (2.0 * HALF_S))
