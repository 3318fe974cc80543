"""The attitude plugin ``mekf``: a multiplicative extended Kalman filter with the gyro's bias."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import require_not_negative, require_positive
from jerkbench.attitude.alignment import align
from jerkbench.attitude.common import TiltAndYaw, Verticals, intervals, loop_arrays, roll_pitch
from jerkbench.attitude.mekf_kernel import ADAPTATIONS, Settings, make_room, run_samples
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.module_cache import can_compile
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler
from jerkbench.parameters import SWITCH, DefaultOrigin, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

FIELD = DefaultOrigin("ours: a consumer MEMS IMU in a hand")


@register("attitude", "mekf")
@dataclass(frozen=True)
class Mekf(TiltAndYaw):
    """A multiplicative extended Kalman filter: a rotation, its error as a vector, and the gyro's bias.

    The nominal state is Omega and b; the error dx = (theta, db) is Omega_true = Omega Exp(theta), b_true = b + db. For
    each sample of length dt, with g = 9.81 m/s2 and x = Omega^T e3::

        Omega = Omega Exp(dt (y_G - b));  F = [[Exp(-dt (y_G - b)), -dt I], [0, I]]
        P = F P F' + dt diag(N_G^2 I, N_b^2 I)
        e = y_A - c a_prev - g x;  H = [g [x], 0] ([x] is the cross product);  C0 = H P H' + N_A^2/dt I
        none: Sigma = 0
        mtf:  Sigma = T/dt diag(max(0, w_i - C0_ii)) if e'e >= tr C0,  w_i = mean of e_i^2 over the window T
        lee:  Sigma = T/dt c^2 |a_prev|^2/3 I
        M = N_A^2/dt I + Sigma;  K = P H' (H P H' + M)^-1;  dx = K e;  Omega = Omega Exp(theta);  b += db
        P = (I - K H) P;  a_prev = y_A - g x

    c is c_a with lee, otherwise 0. M is diagonal, so that the axes are processed one after the other. All noise is a
    density and the window is a time: a setting means the same at 100 and at 286 Hz. The factor T/dt is why: an external
    acceleration stays for about T, and the samples within it are no independent witnesses. With T = dt it is Lee's
    equation, and MTF's.

    With ``bias`` off, db stays 0. Yaw is not its own, but that of `tilt`.

    Source: F. L. Markley, "Attitude error representations for Kalman filtering", Journal of Guidance, Control, and
    Dynamics 26(2), 2003, doi:10.2514/2.5048; ``lee``: J. K. Lee, E. J. Park, S. N. Robinovitch, "Estimation of attitude
    and external acceleration using inertial sensor measurement during various dynamic conditions", IEEE Trans. Instrum.
    Meas. 61(8), 2012, doi:10.1109/TIM.2012.2187245; ``mtf``: multiple tuning factors as in `tilt`.

    Attributes:
        adapt: how Sigma is found: none, mtf or lee.
        gyro_density: N_G [rad/s/sqrt(Hz)].
        accel_density: N_A [m/s2/sqrt(Hz)].
        window_s: T, at least one sample.
        external_memory: c_a, the part of an external acceleration that is expected to last to the next sample (lee).
        bias: estimate the gyro's bias.
        bias_density: N_b, the bias's random walk [rad/s2/sqrt(Hz)].
        initial_bias_radps: one sigma of the bias at the start.
    """

    name: ClassVar[str] = "mekf"

    adapt: str = "none"
    gyro_density: Annotated[
        float,
        Range(1e-4, 1e-2, log=True, source="ours: from a tactical gyro to one that errs with the motion"),
        FIELD,
    ] = 1e-3
    accel_density: Annotated[
        float,
        Range(0.01, 30.0, log=True, source="ours: from quiet ground to hardly any trust in the accelerometer"),
        FIELD,
    ] = 0.1
    window_s: Annotated[
        float, Range(0.01, 3.0, log=True, source="ours: from one sample at 100 Hz to a turn of a car"), FIELD
    ] = 0.01
    external_memory: Annotated[
        float, Range(0.05, 0.95, source="ours: from hardly any memory to hardly any tilt that is seen"), FIELD
    ] = 0.3
    bias: Annotated[bool, SWITCH, DefaultOrigin("ours: MEMS gyros have one")] = True
    bias_density: Annotated[
        float, Range(1e-6, 1e-3, log=True, source="ours: from a bias that stays to one that follows the motion"), FIELD
    ] = 1e-5
    initial_bias_radps: Annotated[float, DefaultOrigin("a data sheet's turn-on bias of a consumer MEMS gyro")] = 0.005

    def __post_init__(self) -> None:
        """Check that every choice exists and every number makes sense."""
        super().__post_init__()
        self._check_choices({"adapt": ADAPTATIONS})
        require_positive("attitude mekf", self, ("accel_density", "window_s"))
        require_not_negative("attitude mekf", self, ("gyro_density", "bias_density", "initial_bias_radps"))
        if not 0 < self.external_memory < 1:
            raise PluginError(f"attitude mekf: external_memory is {self.external_memory}; it must be between 0 and 1.")

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample, and whether an external acceleration was seen."""
        imu, start = recording.inertial, align(recording, alignment=self.alignment)
        x, triggered = np.empty((len(imu.t_s), 3)), np.empty(len(imu.t_s), dtype=np.bool_)
        window = max(1, round(self.window_s / imu.nominal_interval_s))
        C = dcm_from_euler(np.array([*roll_pitch(start.x), 0.0]))
        room = make_room(C, start.variance, self.initial_bias_radps if self.bias else 0.0, window)
        samples = loop_arrays(imu.gyro_radps, imu.accel_mps2, intervals(imu))
        _loop()(room, *samples, self._settings(), x, triggered)
        return x, triggered

    def _settings(self) -> Settings:
        noise = float(self.gyro_density), float(self.accel_density), float(self.bias_density if self.bias else 0.0)
        return Settings(*noise, float(self.window_s), float(self.external_memory), ADAPTATIONS.index(self.adapt))


def _loop() -> Callable[..., None]:
    """The loop, compiled where numba may compile."""
    return _compiled() if can_compile() else run_samples


@cache
def _compiled() -> Callable[..., None]:
    return compiled_loop(run_samples, "the attitude filter mekf", kernel=False)
