"""Factors on the measurement covariances that the receiver reports, as a filter uses them."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

from jerkbench.errors import PluginError, unknown
from jerkbench.recording import Recording


@dataclass(frozen=True)
class RScale:
    """Factors on the covariances that the receiver reports: tunable parameters, as the process noise has them.

    Measurements, their true covariances and the attitude do not change.

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
        return {name: value for name, value in vars(self).items() if value != 1.0}


def scale_of(values: object) -> RScale:
    """Return the factors that a configuration names: a mapping, or None for R as reported.

    Raises:
        PluginError: it is not a mapping, has another name, or a value is not a positive number.
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


def with_r_scale(recording: Recording, scale: RScale) -> Recording:
    """Return ``recording`` with scaled covariances; the true covariances, which an oracle uses, do not change."""
    if not scale.changed:
        return recording
    p, v = recording.position, recording.velocity
    return dataclasses.replace(
        recording,
        position=p and p.changed(p.values, scale.position * p.reported, p.true),
        velocity=v and v.changed(v.values, scale.velocity * v.reported, v.true),
    )
