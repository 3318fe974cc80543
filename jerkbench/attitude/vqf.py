"""The attitude plugins ``vqf`` and ``offline_vqf``: the package vqf, with its own C++."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.common import TiltAndYaw, Verticals, tilt_start
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import ABOVE_ZERO, SWITCH, DefaultOrigin, Range
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording

if TYPE_CHECKING:
    import vqf

SILENCE_S = 0.1
"""Over a longer interval the filter sees several steps of the gyro, each as long as the others."""

OF_PACKAGE = DefaultOrigin("literature: the package's default")


TAU_ACC_S_RANGE = Range(0.3, 300.0, log=True, source="ours: from a tenth to a hundred times the default")
BIAS_FORGETTING_S_RANGE = Range(10.0, 1e4, log=True, source="ours: from a tenth to a hundred times the default")


@register("attitude", "vqf")
@dataclass(frozen=True)
class Vqf(TiltAndYaw):
    """VQF: the specific force, turned into an almost inertial frame by the gyro, goes through a low-pass there.

    With I the frame in which the gyro alone holds the body, and E that of the Earth::

        q_I: strapdown integration of y_G - b;  f_I = q_I y_A;  l = second-order Butterworth low-pass of f_I
        q_E <- I turns l upwards by the shortest way;  the time constant tau_acc: cut-off sqrt(2)/(2 pi tau_acc)

    The bias b has a Kalman filter of its own: at rest the low-passed rate shows it; in motion, on request, the
    difference between the inclination before and after the correction. The package does all of it (full version, no
    magnetometer); yaw is not its own, but that of `tilt`.

    It takes samples of one rate: each counts as one nominal interval, and one after a gap of more than .1 s as so many
    turns without an accelerometer first as fit into it. ``alignment`` gravity leaves the start to the package: the mean
    specific force over its first tau_acc. With the others it first sees two tau_acc of rest in that attitude,
    without any estimate of the bias.

    Its authors tuned the defaults on BROAD and five other sets of hand-held IMUs.

    Source: D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic
    disturbance rejection", Information Fusion 91, 187-204, 2023, doi:10.1016/j.inffus.2022.10.014; the package vqf
    (MIT), the extra ``attitude``.

    Attributes:
        tau_acc_s: time constant of the low-pass.
        rest_bias: estimate the bias at rest.
        motion_bias: estimate it in motion.
        bias_forgetting_s: time in which the bias grows as uncertain as it was at first.
    """

    name: ClassVar[str] = "vqf"

    alignment: str = field(default="gravity", kw_only=True)
    tau_acc_s: Annotated[float, ABOVE_ZERO, TAU_ACC_S_RANGE, OF_PACKAGE] = 3.0
    rest_bias: Annotated[bool, SWITCH, OF_PACKAGE] = True
    motion_bias: Annotated[bool, SWITCH, OF_PACKAGE] = True
    bias_forgetting_s: Annotated[float, ABOVE_ZERO, BIAS_FORGETTING_S_RANGE, OF_PACKAGE] = 100.0

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the package is installed and the recording has what was asked to be used.

        Raises:
            PluginError: the package is not installed.
        """
        vqf_package()
        super().require(load)

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample."""
        imu = recording.inertial
        package, step_s = vqf_package(), imu.nominal_interval_s
        filter_ = package.VQF(step_s, **self._parameters())
        if self.alignment != "gravity":
            self._settle(filter_, tilt_start(recording, alignment=self.alignment).x, step_s)
        gaps = np.flatnonzero(imu.intervals_s > SILENCE_S)
        parts = []
        for begin, end in zip([0, *gaps], [*gaps, len(imu.t_s)], strict=True):
            if begin in gaps:
                for _ in range(round(imu.intervals_s[begin] / step_s) - 1):
                    filter_.updateGyr(imu.gyro_radps[begin].copy())
            if end > begin:
                parts.append(filter_.updateBatch(*_samples(imu, begin, end))["quat6D"])
        return vertical_of(np.concatenate(parts)), None

    def _parameters(self) -> dict[str, Any]:
        """What the package calls them."""
        enabled = {"restBiasEstEnabled": self.rest_bias, "motionBiasEstEnabled": self.motion_bias}
        return {"tauAcc": self.tau_acc_s, "biasForgettingTime": self.bias_forgetting_s, **enabled}

    def _settle(self, filter_: "vqf.VQF", x: FloatArray, step_s: float) -> None:
        """Hold the filter still until its low-pass shows the start."""
        steps = math.ceil(2 * self.tau_acc_s / step_s)
        filter_.setRestBiasEstEnabled(False)
        filter_.setMotionBiasEstEnabled(False)
        filter_.updateBatch(np.zeros((steps, 3)), np.tile(GRAVITY_MPS2 * x, (steps, 1)))
        filter_.setRestBiasEstEnabled(self.rest_bias)
        filter_.setMotionBiasEstEnabled(self.motion_bias)


@register("attitude", "offline_vqf")
@dataclass(frozen=True)
class OfflineVqf(Vqf):
    """VQF forwards and backwards over the whole recording: a smoother, which no filter can be compared with.

    The equations are those of `vqf`; the low-pass has no lag, and each bias knows what came after it. It shows how much
    of an error is the lack of a future. It finds its own start, and takes no recording with a gap above .1 s.
    """

    name: ClassVar[str] = "offline_vqf"

    def __post_init__(self) -> None:
        """Check that nobody asks for another start."""
        super().__post_init__()
        if self.alignment != "gravity":
            reason = "a smoother finds its start itself (gravity)."
            raise PluginError(f"attitude offline_vqf: alignment is {self.alignment}; {reason}")

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample, from all of them."""
        imu = recording.inertial
        if imu.intervals_s.max() > SILENCE_S:
            raise RecordingError(
                f"{recording.name} has a gap of {imu.intervals_s.max():.2f} s between two samples, and attitude"
                f" offline_vqf takes samples of one rate; take vqf, or a part without a gap above {SILENCE_S} s."
            )
        samples, step_s = _samples(imu, 0, len(imu.t_s)), imu.nominal_interval_s
        return vertical_of(vqf_package().offlineVQF(*samples, None, step_s, self._parameters())["quat6D"]), None


def vertical_of(q: FloatArray) -> FloatArray:
    """Return x = Omega^T e3 (n, 3) of quaternions w, x, y, z (n, 4) from the body to a frame whose z is up."""
    w, a, b, c = q.T
    return np.column_stack([2 * (a * c - w * b), 2 * (w * a + b * c), w * w - a * a - b * b + c * c])


def _samples(imu: Imu, begin: int, end: int) -> tuple[FloatArray, FloatArray]:
    """Gyro and accelerometer, writable and contiguous, as the package's C++ takes them."""
    return imu.gyro_radps[begin:end].copy(), imu.accel_mps2[begin:end].copy()


def vqf_package() -> Any:  # noqa: ANN401 - a module that may be missing
    """Return the package vqf.

    Raises:
        PluginError: it is not installed.
    """
    try:
        import vqf
    except ImportError as error:
        raise PluginError("attitude vqf needs the package vqf: pip install 'jerkbench[attitude]'.") from error
    return vqf
