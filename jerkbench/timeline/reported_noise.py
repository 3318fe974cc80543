"""The measurement noise that a filter is told: the reported R, scaled, whatever the data are."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, unknown
from jerkbench.estimate import Attitude
from jerkbench.recording import Position, Recording, Velocity
from jerkbench.timeline.measurements import FLOOR, Measurements, floored, gather
from jerkbench.timeline.start import start_motion
from jerkbench.timeline.timeline import Timeline


@dataclass(frozen=True)
class RScale:
    """Factors on the covariances that the receiver reports, as the filter is told them.

    A knob of tuning like those of Q. Measurements, their true covariances and the attitude stay what they are.

    Attributes:
        position: factor on the covariance of each position [-].
        velocity: factor on the covariance of each velocity [-].
    """

    position: float = 1.0
    velocity: float = 1.0

    def __post_init__(self) -> None:
        """Check that the factors are positive numbers."""
        for name in ("position", "velocity"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise PluginError(f"r_scale.{name} is {value}; it must be a positive number; 1 leaves R as reported.")

    @property
    def changed(self) -> dict[str, float]:
        """The factors that are not 1, by name."""
        return {name: value for name, value in dataclasses.asdict(self).items() if value != 1.0}


def scale_of(values: object) -> RScale:
    """Return the factors that a configuration names: a mapping, or None for R as reported.

    Raises:
        PluginError: it is no mapping, names something else, or holds what is no positive number.
    """
    known = [f.name for f in dataclasses.fields(RScale)]
    factors = {} if values is None else values
    if not isinstance(factors, Mapping):
        raise PluginError(f"r_scale is {factors}; it has two parts: r_scale.position=2 r_scale.velocity=0.5.")
    for name, value in factors.items():
        if name not in known:
            raise PluginError(unknown("parameter of r_scale", str(name), known))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise PluginError(f"r_scale.{name} is {value}; it must be a positive number; 1 leaves R as reported.")
    return RScale(**{name: float(value) for name, value in factors.items()})


AS_REPORTED = RScale()
"""R as the receiver reports it."""


def told(recording: Recording, scale: RScale) -> Recording:
    """Return ``recording`` with the covariances that a filter is told; what an oracle is told stays."""
    if not scale.changed:
        return recording
    p, v = recording.position, recording.velocity
    return dataclasses.replace(
        recording,
        position=None if p is None else _told_position(p, scale.position),
        velocity=None if v is None else _told_velocity(v, scale.velocity),
    )


def told_timeline(timeline: Timeline, recording: Recording, attitude: Attitude, scale: RScale) -> Timeline:
    """Return what `build_timeline` makes of `told`, to the bit, from the ``timeline`` of ``recording`` itself.

    It takes a tenth of the time, and shares with ``timeline`` all that no covariance changes.
    """
    if not scale.changed:
        return timeline
    before = timeline.measurements
    R = _scaled(before, scale) if _can_scale(before, recording) else gather(told(recording, scale), attitude).R
    measurements = dataclasses.replace(before, R=R)
    first = int(np.searchsorted(before.t_ns, round(timeline.t_s[0] * 1e9)))
    x0, P0 = start_motion(measurements, first, attitude if recording.imu else None, timeline.dt0_s)
    return dataclasses.replace(timeline, measurements=measurements, x0=x0, P0=P0)


def _told_position(position: Position, factor: float) -> Position:
    reported, true = position.covariance_m2, position.true_covariance_m2
    return dataclasses.replace(
        position, covariance_m2=factor * reported, true_covariance_m2=reported if true is None else true
    )


def _told_velocity(velocity: Velocity, factor: float) -> Velocity:
    reported, true = velocity.covariance_m2ps2, velocity.true_covariance_m2ps2
    return dataclasses.replace(
        velocity, covariance_m2ps2=factor * reported, true_covariance_m2ps2=reported if true is None else true
    )


def _can_scale(measurements: Measurements, recording: Recording) -> bool:
    """Whether R is the reported covariance itself: not turned, and no variance was raised to the floor."""
    as_it_is = recording.velocity is None or recording.velocity.frame == "enu"
    return as_it_is and bool((np.einsum("nii->ni", measurements.R) > FLOOR).all())


def _scaled(measurements: Measurements, scale: RScale) -> FloatArray:
    R = measurements.R.copy()
    for block, factor in ((slice(0, 3), scale.position), (slice(3, 6), scale.velocity)):
        present = np.isfinite(measurements.z[:, block]).any(axis=1)
        R[present, block, block] *= factor
    return floored(R)
