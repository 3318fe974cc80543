"""The factors of the attribution, and what is run at each of their corners."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

from jerkbench.audit.attribution.shapley import Corner
from jerkbench.audit.methods import Method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.presets import preset
from jerkbench.tuning.samplers import sampler_of
from jerkbench.tuning.space import Setting, Space

MODEL, ADAPTATION, Q, R, ATTITUDE = "model", "adaptation", "tuning of Q", "tuning of R", "attitude"
FACTORS = (MODEL, ADAPTATION, Q, R, ATTITUDE)

ATTITUDES = {False: "gyro_only", True: None}
"""Off: the gyro alone after the alignment; on: what belongs to the field, the tilt filter."""

TUNED_PARTS = {Q: ("filter",), R: ("r_scale", "adaptation")}
"""Whose parameters belong to which tuning: an adaptation's are those of R."""

SUBSETS: tuple[Corner, ...] = tuple(frozenset(names) for names in ((), (Q,), (R,), (Q, R)))
"""What may be tuned."""


@dataclass(frozen=True)
class Naive:
    """The values of the naive filters: the process noise that nobody tuned.

    Attributes:
        values: by the name of a knob.
    """

    values: Mapping[str, float]


def naive() -> Naive:
    """Return the noise of the preset `naive`: the accelerometer's own."""
    noise = preset("noise", "naive")
    return Naive({f"filter.{name}": float(value) for name, value in noise.items() if isinstance(value, (int, float))})


def naive_space(space: Space, start: Naive) -> Space:
    """Return the knobs beginning from the naive values."""
    return Space(
        tuple(dataclasses.replace(knob, start=start.values.get(knob.name, knob.start)) for knob in space.knobs)
    )


def subset_settings(space: Space, subset: Corner, trials: int) -> tuple[Setting, ...]:
    """Return the settings that are tried where only the knobs of ``subset`` are tuned; the others keep their start."""
    parts = {part for name in subset for part in TUNED_PARTS[name]}
    varied = [k for k, knob in enumerate(space.knobs) if knob.part in parts]
    if not varied or trials < 2:
        return (space.start,)
    shares = sampler_of("sobol", len(varied), 0).ask(trials - 1)
    return (space.start, *(_varied(space, dict(zip(varied, point, strict=True))) for point in shares.tolist()))


def _varied(space: Space, shares: Mapping[int, float]) -> Setting:
    return tuple(knob.value(shares[k]) if k in shares else knob.start for k, knob in enumerate(space.knobs))


def methods_of(protocol: AuditProtocol) -> dict[Corner, Method]:
    """Return the method where model and adaptation are off and on: the first and the last of the protocol's."""
    models = {False: protocol.filters[0], True: protocol.filters[-1]}
    rules = {False: protocol.plain, True: protocol.compared[-1]}
    return {
        frozenset(name for name, on in ((MODEL, jerk), (ADAPTATION, mtf)) if on): Method(models[jerk], rules[mtf])
        for jerk, mtf in product((False, True), repeat=2)
    }
