"""Factors on the measurement covariances R that a receiver reports."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from jerkbench.errors import PluginError, require_known
from jerkbench.parameters import Limit, Limited
from jerkbench.recording import Recording

_FACTOR = Limit(
    lambda factor: isinstance(factor, float) and 0 < factor < math.inf,
    "r_scale needs positive numbers (1 leaves R as reported).",
)


@dataclass(frozen=True)
class RScale(Limited):
    """Factors on the reported covariances R. The factors are tunable parameters, like the process noise.

    The factors change neither the measurements nor the true covariances nor the attitude.

    Attributes:
        position: Factor on the covariance of each position [-].
        velocity: Factor on the covariance of each velocity [-].
    """

    position: Annotated[float, _FACTOR] = 1.0
    velocity: Annotated[float, _FACTOR] = 1.0

    @property
    def changed(self) -> dict[str, float]:
        """The factors that differ from 1, by name (position, velocity)."""
        return {name: value for name, value in vars(self).items() if value != 1.0}


def scale_of(values: object) -> RScale:
    """Return the factors in the mapping ``values``. If ``values`` is None, both factors are 1.

    Raises:
        PluginError: ``values`` is not a mapping, a key is unknown, or a factor is not a positive number.
    """
    factors = {} if values is None else values
    if not isinstance(factors, Mapping):
        raise PluginError(f"r_scale is {factors}; give two factors: r_scale.position=2 r_scale.velocity=0.5.")
    for name in factors:
        require_known("parameter of r_scale", str(name), [f.name for f in dataclasses.fields(RScale)])
    return RScale(**{name: float(value) if type(value) is int else value for name, value in factors.items()})


AS_REPORTED = RScale()
"""The factors that leave R as the receiver reports it."""


def with_r_scale(recording: Recording, scale: RScale) -> Recording:
    """Return the recording with scaled reported covariances and unchanged true covariances, which an oracle uses."""
    if not scale.changed:
        return recording
    p, v = recording.position, recording.velocity
    return dataclasses.replace(
        recording,
        position=p and p.changed(p.values, scale.position * p.reported, p.true),
        velocity=v and v.changed(v.values, scale.velocity * v.reported, v.true),
    )
