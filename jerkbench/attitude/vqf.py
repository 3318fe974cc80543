"""The attitude plugins ``vqf`` and ``offline_vqf``, which call the package vqf."""

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
"""Maximum interval between two samples [s]. A longer interval is a gap, which is bridged by several gyro updates."""

OF_PACKAGE = DefaultOrigin("literature: the default of the package")


TAU_ACC_S_RANGE = Range(0.3, 300.0, log=True, source="ours: from 0.1 to 100 times the default")
BIAS_FORGETTING_S_RANGE = Range(10.0, 1e4, log=True, source="ours: from 0.1 to 100 times the default")


@register("attitude", "vqf")
@dataclass(frozen=True)
class Vqf(TiltAndYaw):
    """VQF: a low-pass filter of the specific force in an almost inertial frame that is determined by the gyro.

    The frame I results from the integrated gyro only, and the frame E is fixed to the Earth::

        q_I: strapdown integration of y_G - b;  f_I = q_I y_A;  l = second-order Butterworth low-pass of f_I
        q_E <- I: shortest rotation of l to the vertical;  cut-off frequency sqrt(2)/(2 pi tau_acc)

    A separate Kalman filter estimates the gyro bias b. At rest, the Kalman filter uses the low-passed angular rate. In
    motion, the Kalman filter can also use the difference between the inclinations before and after the correction. The
    package vqf performs all computations of the tilt (full version, without a magnetometer). The yaw is computed in the
    same way as in the plugin `tilt`.

    The package expects a constant sampling rate, so every sample is processed with the nominal interval. A gap of more
    than 0.1 s is first filled with gyro updates without the accelerometer. With ``alignment`` gravity, the package
    computes the initial tilt from the mean specific force of the first tau_acc seconds. With the alignments rest and
    track, the package first processes artificial samples at rest in the initial attitude for 2 tau_acc, with the bias
    estimation disabled.

    The authors of VQF tuned the default parameters on BROAD and five other data sets of hand-held IMUs.

    Source: D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic
    disturbance rejection", Information Fusion 91, 187-204, 2023, doi:10.1016/j.inffus.2022.10.014; the package vqf
    (MIT), the extra ``attitude``.

    Attributes:
        tau_acc_s: tau_acc, time constant of the low-pass filter of the specific force [s].
        rest_bias: if true, the gyro bias is estimated at rest.
        motion_bias: if true, the gyro bias is estimated in motion.
        bias_forgetting_s: time in which the standard deviation of the gyro bias increases from 0 to 0.1 deg/s [s].
    """

    name: ClassVar[str] = "vqf"

    alignment: str = field(default="gravity", kw_only=True)
    tau_acc_s: Annotated[float, ABOVE_ZERO, TAU_ACC_S_RANGE, OF_PACKAGE] = 3.0
    rest_bias: Annotated[bool, SWITCH, OF_PACKAGE] = True
    motion_bias: Annotated[bool, SWITCH, OF_PACKAGE] = True
    bias_forgetting_s: Annotated[float, ABOVE_ZERO, BIAS_FORGETTING_S_RANGE, OF_PACKAGE] = 100.0

    def require(self, load: Callable[[], Recording]) -> None:
        """Check before a sweep that the package vqf is installed and that the recording has the required data.

        Raises:
            PluginError: the package vqf is not installed.
            RecordingError: the recording has no data of the yaw source, or no velocities for the alignment ``track``.
        """
        vqf_package()
        super().require(load)

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3) after each sample. The mask of detected accelerations is None."""
        imu = recording.inertial
        package, step_s = vqf_package(), imu.nominal_interval_s
        filter_ = package.VQF(step_s, **self._parameters())
        if self.alignment != "gravity":
            self._settle(filter_, tilt_start(recording, alignment=self.alignment).x, step_s)
        gaps = np.flatnonzero(imu.intervals_s > SILENCE_S)
        parts = []
        for start, end in zip([0, *gaps], [*gaps, len(imu.t_s)], strict=True):
            if start in gaps:
                for _ in range(round(imu.intervals_s[start] / step_s) - 1):
                    filter_.updateGyr(imu.gyro_radps[start].copy())
            if end > start:
                parts.append(filter_.updateBatch(*_samples(imu, start, end))["quat6D"])
        return vertical_of(np.concatenate(parts)), None

    def _parameters(self) -> dict[str, Any]:
        """Return the values of the parameters by their names in the package vqf."""
        enabled = {"restBiasEstEnabled": self.rest_bias, "motionBiasEstEnabled": self.motion_bias}
        return {"tauAcc": self.tau_acc_s, "biasForgettingTime": self.bias_forgetting_s, **enabled}

    def _settle(self, filter_: "vqf.VQF", x: FloatArray, step_s: float) -> None:
        """Process artificial samples at rest in the initial attitude until the low-pass filter has converged."""
        steps = math.ceil(2 * self.tau_acc_s / step_s)
        filter_.setRestBiasEstEnabled(False)
        filter_.setMotionBiasEstEnabled(False)
        filter_.updateBatch(np.zeros((steps, 3)), np.tile(GRAVITY_MPS2 * x, (steps, 1)))
        filter_.setRestBiasEstEnabled(self.rest_bias)
        filter_.setMotionBiasEstEnabled(self.motion_bias)


@register("attitude", "offline_vqf")
@dataclass(frozen=True)
class OfflineVqf(Vqf):
    """VQF forwards and backwards over the complete recording; a smoother, which cannot be used online.

    The equations are the same as in `vqf`, but the low-pass filter has no delay, and the bias estimates also use later
    samples. The difference between the results with `vqf` and with `offline_vqf` shows the effect of later samples. The
    package computes the initial tilt, so the only supported ``alignment`` is gravity. Recordings with a gap of more
    than 0.1 s are not supported.
    """

    name: ClassVar[str] = "offline_vqf"

    def __post_init__(self) -> None:
        """Check that ``alignment`` is gravity, because the smoother of the package supports no other alignment.

        Raises:
            PluginError: ``alignment`` is not gravity.
        """
        super().__post_init__()
        if self.alignment != "gravity":
            raise PluginError(
                f"attitude offline_vqf: alignment is {self.alignment}; it must be gravity, because the smoother"
                " computes the initial tilt."
            )

    def verticals(self, recording: Recording) -> Verticals:
        """Return the vertical x = Omega^T e3 (n, 3), smoothed over all samples. The mask of accelerations is None."""
        imu = recording.inertial
        if imu.intervals_s.max() > SILENCE_S:
            raise RecordingError(
                f"{recording.name} has a gap of {imu.intervals_s.max():.2f} s between two IMU samples, but offline_vqf"
                f" needs a constant rate. Use attitude=vqf, or a part of the recording without gaps above {SILENCE_S}"
                " s."
            )
        samples, step_s = _samples(imu, 0, len(imu.t_s)), imu.nominal_interval_s
        return vertical_of(vqf_package().offlineVQF(*samples, None, step_s, self._parameters())["quat6D"]), None


def vertical_of(q: FloatArray) -> FloatArray:
    """Return the verticals x = Omega^T e3 (n, 3) of quaternions (n, 4) from the body to a frame whose z axis is up."""
    w, a, b, c = q.T
    return np.column_stack([2 * (a * c - w * b), 2 * (w * a + b * c), w * w - a * a - b * b + c * c])


def _samples(imu: Imu, start: int, end: int) -> tuple[FloatArray, FloatArray]:
    """Return copies of gyro and accelerometer rows, because the package vqf requires writable, contiguous arrays."""
    return imu.gyro_radps[start:end].copy(), imu.accel_mps2[start:end].copy()


def vqf_package() -> Any:  # noqa: ANN401 - a module that may be missing
    """Import the package vqf and return the module.

    Raises:
        PluginError: the package vqf is not installed.
    """
    try:
        import vqf
    except ImportError as error:
        raise PluginError(
            "attitude vqf needs the package vqf; install it with `pip install 'jerkbench[attitude]'`."
        ) from error
    return vqf
