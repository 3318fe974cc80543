"""The group ``noise``: process noise that replaces the filter's own."""

import dataclasses
from collections.abc import Mapping
from typing import Any


@dataclasses.dataclass
class Noise:
    """Process noise parameters; one that is set replaces the filter's own field of that name.

    Attributes:
        accel_mps2: sigma_a, noise of one sample of the acceleration [m/s2].
        jerk_mps3_per_sqrt_s: random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: one sigma of the jerk at the start [m/s3].
        bias_mps2_per_sqrt_s: random walk of the acceleration bias [m/s2/sqrt(s)].
        initial_bias_mps2: one sigma of the acceleration bias at the start [m/s2].
    """

    accel_mps2: float | None = None
    jerk_mps3_per_sqrt_s: float | None = None
    initial_jerk_mps3: float | None = None
    bias_mps2_per_sqrt_s: float | None = None
    initial_bias_mps2: float | None = None


def replaced(cls: type, noise: Mapping[str, Any]) -> dict[str, float]:
    """Return the fields of `Noise` that are set and that the filter class has; nothing else of a filter is noise."""
    own = {f.name for f in dataclasses.fields(cls)} & {f.name for f in dataclasses.fields(Noise)}
    return {name: value for name, value in noise.items() if value is not None and name in own}
