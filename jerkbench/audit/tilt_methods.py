"""The attitude filters of an audit, and the settings that each may be tuned to: as many each, from the ranges alone.

Every number is drawn from the range of its plugin (`jerkbench show`), on its scale; every switch is drawn as well: the
estimate of the gyro's bias, and how a vehicle in motion starts. Noise is a density and a window is a time, so that a
setting means the same at 100 and at 286 Hz. The defaults are not among the settings: some were tuned on these trials.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from jerkbench.attitude.common import TiltAndYaw
from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.madgwick import Madgwick
from jerkbench.attitude.mahony import Mahony
from jerkbench.attitude.mekf import Mekf
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.vqf import OfflineVqf, Vqf
from jerkbench.parameters import SWITCH, Range, ranges_of
from jerkbench.tuning.samplers import Sobol

TiltSetting = Mapping[str, float]
"""Values of the ranges, and 0 or 1 of the switches."""

TILT_SETTINGS = 64
"""Tried of each method, on every trial."""


@dataclass(frozen=True)
class TiltMethod:
    """An attitude filter with what may be tuned of it.

    Attributes:
        ranges: of its numbers.
        switches: names of those, besides ``gravity``: a start in motion is the accelerometer's first second, or level.
        make: the plugin of a setting, at a number of samples a second, with an alignment.
    """

    ranges: Mapping[str, Range]
    switches: tuple[str, ...]
    make: Callable[[TiltSetting, float, str], TiltAndYaw]

    def plugin(self, setting: TiltSetting, rate_hz: float, alignment: str = "") -> TiltAndYaw:
        """Return the plugin of a setting; an ``alignment`` that is given replaces that of the setting."""
        return self.make(setting, rate_hz, alignment or ("gravity" if setting["gravity"] else "rest"))

    def settings(self) -> list[TiltSetting]:
        """Return the first points of a scrambled Sobol sequence, with all switches."""
        names = [*self.ranges, *self.switches, "gravity"]
        points = Sobol(len(names), 0).ask(TILT_SETTINGS)
        return [{name: self._value(name, share) for name, share in zip(names, point, strict=True)} for point in points]

    def _value(self, name: str, share: float) -> float:
        return self.ranges[name].value(float(share)) if name in self.ranges else float(share >= 0.5)


def _numbers(cls: type, *names: str) -> dict[str, Range]:
    """The ranges of ``names``; of all parameters but the switches, where none is named."""
    ranges = ranges_of(cls).items()
    return {name: bounds for name, bounds in ranges if bounds is not SWITCH and (name in names or not names)}


def _tilt(adapt: str, *names: str) -> TiltMethod:
    """The paper's filter; its noise of a sample follows from the density, and its window from the time."""

    def make(setting: TiltSetting, rate_hz: float, alignment: str) -> Tilt:
        return Tilt(
            adapt,
            setting["gyro_density"] * np.sqrt(rate_hz),
            setting["accel_density"] * np.sqrt(rate_hz),
            setting.get("external_memory", 0.0),
            max(1, round(setting.get("window_s", 0.0) * rate_hz)),
            propagation="exact",
            alignment=alignment,
        )

    return TiltMethod(_numbers(Mekf, "gyro_density", "accel_density", *names), (), make)


def _mekf(adapt: str, *names: str) -> TiltMethod:
    """The multiplicative filter."""
    names = ("gyro_density", "accel_density", "bias_density", *names)

    def make(setting: TiltSetting, _: float, alignment: str) -> Mekf:
        numbers: Any = {name: setting[name] for name in names}
        return Mekf(adapt, **numbers, bias=bool(setting["bias"]), alignment=alignment)

    return TiltMethod(_numbers(Mekf, *names), ("bias",), make)


def _madgwick(setting: TiltSetting, _: float, alignment: str) -> Madgwick:
    return Madgwick(setting["gain_per_s"], alignment=alignment)


def _mahony(setting: TiltSetting, _: float, alignment: str) -> Mahony:
    integral = setting["integral_per_s2"] if setting["bias"] else 0.0
    return Mahony(setting["proportional_per_s"], integral, alignment=alignment)


def _vqf(setting: TiltSetting, _: float, alignment: str) -> Vqf:
    bias = bool(setting["rest_bias"]), bool(setting["motion_bias"])
    return Vqf(setting["tau_acc_s"], *bias, setting["bias_forgetting_s"], alignment=alignment)


TILT_METHODS = {
    "constant": _tilt("none"),
    "mtf": _tilt("mtf", "window_s"),
    "lee": _tilt("lee", "external_memory"),
    "mekf": _mekf("none"),
    "mekf_mtf": _mekf("mtf", "window_s"),
    "mekf_lee": _mekf("lee", "window_s", "external_memory"),
    "madgwick": TiltMethod(_numbers(Madgwick), (), _madgwick),
    "mahony": TiltMethod(_numbers(Mahony), ("bias",), _mahony),
    "vqf": TiltMethod(_numbers(Vqf), ("rest_bias", "motion_bias"), _vqf),
}
"""Those that are tuned and ranked."""

AS_THEY_COME = {
    "constant, default": Tilt("none", sigma_accel_mps2=2.0, propagation="exact"),
    "mtf, default": Tilt("mtf", sigma_accel_mps2=0.5, propagation="exact"),
    "lee, default": Tilt("lee", 0.1, 10.0, 0.3, propagation="exact"),
    "mekf, default": Mekf(),
    "mekf_mtf, default": Mekf("mtf"),
    "mekf_lee, default": Mekf("lee"),
    "madgwick, default": Madgwick(),
    "mahony, default": Mahony(),
    "vqf, default": Vqf(),
    "gyro_only": GyroOnly(),
    "offline_vqf": OfflineVqf(),
}
"""Not tuned; offline_vqf is a smoother, shown and never ranked."""
