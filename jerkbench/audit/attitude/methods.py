"""The methods, and the settings that each may be tuned to: as many for each, from the ranges alone.

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

SETTINGS = 64
"""Tried of each method, on every trial."""

PLAIN = ("gyro_density", "accel_density")


@dataclass(frozen=True)
class TiltMethod:
    """An attitude filter with what may be tuned of it.

    Attributes:
        ranges: of its numbers.
        switches: names of those.
        make: the plugin of a setting, at a number of samples a second.
        default: the plugin as it comes.
    """

    ranges: Mapping[str, Range]
    switches: tuple[str, ...]
    make: Callable[[TiltSetting, float], TiltAndYaw]
    default: TiltAndYaw

    def settings(self) -> list[TiltSetting]:
        """Return the first points of a scrambled Sobol sequence, with all switches."""
        names = [*self.ranges, *self.switches]
        points = Sobol(len(names), 0).ask(SETTINGS)
        return [{name: self._value(name, share) for name, share in zip(names, point, strict=True)} for point in points]

    def _value(self, name: str, share: float) -> float:
        return self.ranges[name].value(float(share)) if name in self.ranges else float(share >= 0.5)


def _start(setting: TiltSetting) -> str:
    """How it starts in motion: the accelerometer's first second, or level."""
    return "gravity" if setting["gravity"] else "rest"


def _tilt(adapt: str) -> TiltMethod:
    """The paper's filter; its noise of a sample follows from the density."""
    names = PLAIN + {"none": (), "mtf": ("window_s",), "lee": ("external_memory",)}[adapt]

    def make(setting: TiltSetting, rate_hz: float) -> Tilt:
        return Tilt(
            adapt,
            setting["gyro_density"] * np.sqrt(rate_hz),
            setting["accel_density"] * np.sqrt(rate_hz),
            setting.get("external_memory", 0.0),
            max(1, round(setting.get("window_s", 0.0) * rate_hz)),
            propagation="exact",
            alignment=_start(setting),
        )

    return TiltMethod(_of(Mekf, names), ("gravity",), make, Tilt("mtf", sigma_accel_mps2=0.5, propagation="exact"))


def _mekf(adapt: str) -> TiltMethod:
    """The multiplicative filter; the walk of the bias counts where it has one."""
    names = (*PLAIN, "bias_density", *{"none": (), "mtf": ("window_s",), "lee": ("window_s", "external_memory")}[adapt])

    def make(setting: TiltSetting, rate_hz: float) -> Mekf:
        del rate_hz
        numbers: Any = {name: setting[name] for name in names}
        return Mekf(adapt, **numbers, bias=bool(setting["bias"]), alignment=_start(setting))

    return TiltMethod(_of(Mekf, names), ("bias", "gravity"), make, Mekf(adapt))


def _vqf(setting: TiltSetting, rate_hz: float) -> Vqf:
    """VQF; its start is its own, or level."""
    del rate_hz
    bias = bool(setting["rest_bias"]), bool(setting["motion_bias"])
    return Vqf(setting["tau_acc_s"], *bias, setting["bias_forgetting_s"], alignment=_start(setting))


def _madgwick(setting: TiltSetting, rate_hz: float) -> Madgwick:
    """Madgwick's filter, which has no bias."""
    del rate_hz
    return Madgwick(setting["gain_per_s"], alignment=_start(setting))


def _mahony(setting: TiltSetting, rate_hz: float) -> Mahony:
    """Mahony's filter, with the integral or without."""
    del rate_hz
    integral = setting["integral_per_s2"] if setting["bias"] else 0.0
    return Mahony(setting["proportional_per_s"], integral, alignment=_start(setting))


def _of(cls: type, names: tuple[str, ...]) -> dict[str, Range]:
    return {name: bounds for name, bounds in ranges_of(cls).items() if name in names and bounds is not SWITCH}


METHODS = {
    "constant": _tilt("none"),
    "mtf": _tilt("mtf"),
    "lee": _tilt("lee"),
    "mekf": _mekf("none"),
    "mekf_mtf": _mekf("mtf"),
    "mekf_lee": _mekf("lee"),
    "madgwick": TiltMethod(dict(ranges_of(Madgwick)), ("gravity",), _madgwick, Madgwick()),
    "mahony": TiltMethod(dict(ranges_of(Mahony)), ("bias", "gravity"), _mahony, Mahony()),
    "vqf": TiltMethod(
        _of(Vqf, ("tau_acc_s", "bias_forgetting_s")), ("rest_bias", "motion_bias", "gravity"), _vqf, Vqf()
    ),
}
"""Those that are tuned and ranked."""

AS_THEY_COME = {
    **{f"{name}, default": method.default for name, method in METHODS.items()},
    "constant, default": Tilt("none", sigma_accel_mps2=2.0, propagation="exact"),
    "lee, default": Tilt("lee", 0.1, 10.0, 0.3, propagation="exact"),
    "gyro_only": GyroOnly(),
    "offline_vqf": OfflineVqf(),
}
"""Not tuned; offline_vqf is a smoother, shown and never ranked."""
