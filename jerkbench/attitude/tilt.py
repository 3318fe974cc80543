"""The attitude plugin ``tilt``: tilt filter, yaw filter and gravity compensation one after the other."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import require_not_negative
from jerkbench.attitude.alignment import align
from jerkbench.attitude.common import TiltAndYaw, Verticals, intervals
from jerkbench.attitude.tilt_filter import TiltParameters, run_tilt
from jerkbench.attitude.tilt_kernel import ADAPTATIONS
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording

PROPAGATIONS = ("first_order", "exact")


@register("attitude", "tilt")
@dataclass(frozen=True)
class Tilt(TiltAndYaw):
    """Tilt from gyro and accelerometer, adaptive to external acceleration; yaw from headings, course or track.

    Tilt, at the IMU rate, x = Omega^T e3 (the vertical of ENU seen from the body), g = 9.81 m/s2::

        Phi = I - dt skew(y_G)   (exact: exp(-dt skew(y_G)))
        Q = -dt^2 sigma_G^2 skew(x+)^2;  x- = Phi x+;  P- = Phi P+ Phi' + Q
        z = y_A - c_a a_prev;  e = z - g x-;  C0 = g^2 P- + sigma_A^2 I
        triggered = e'e >= tr(C0)
        none:   Sigma = 0
        mtf:    Sigma = diag(max(0, w_i - C0_ii)) if triggered,  w_i = mean of e_i^2 over the last mu samples
        scalar: Sigma = I (e'e - tr C0)/3 if triggered
        lee:    Sigma = I c_a^2 |a_prev|^2/3, always
        M = sigma_A^2 I + Sigma;  K = g P- (g^2 P- + M)^-1;  x = x- + K e
        P = (I - gK) P- (I - gK)' + K M K', symmetrised;  x /= |x|;  a_prev = y_A - g x
        roll = atan2(x2, x3);  pitch = atan2(-x1, hypot(x2, x3))

    Start: P = 1e-3 I at rest or by the track, .03 I moving. a_prev = 0.

    Yaw, one state::

        yaw += dt (w_y sin(roll) + w_z cos(roll))/cos(pitch);  P += dt walk^2;  P0 = variance of the first heading
        course: atan2(v_n, v_e), sigma = max(sigma_v/speed, minimum), sigma_v across the course

    Sample k uses headings up to its own time; before the first one, that one less the integrated gyro. Without
    headings and velocity over ground, yaw comes from the track of the fixes, and the bias of the gyro with it::

        chord: between two fixes, as short as its sigma allows (.05 rad); none overlaps another
        offset of yaw from psi, the integrated gyro = arg(chord) - arg(int e^{i psi} dt) half a chord before its end
        two states, offset and its rate;  F = [[1, dt], [0, 1]],  H = [1, -half the chord's length]

    Where it shows nothing either, and with gyro_only, yaw starts at 0 (east). The yaw rate is singular at a pitch of 90
    degrees. A course, and a track, take the vehicle to drive forwards.

    Input of the navigation filter: u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g), or Omega_k y_A + (0, 0, -g).

    Source: J. K. Lee, E. J. Park, S. N. Robinovitch, "Estimation of attitude and external acceleration using inertial
    sensor measurement during various dynamic conditions", IEEE Trans. Instrum. Meas. 61(8), 2262-2273, 2012,
    doi:10.1109/TIM.2012.2187245, for the state, Q and ``lee``; multiple tuning factors for ``mtf``.

    Attributes:
        adapt: how Sigma is found: none, mtf, scalar or lee.
        sigma_gyro_radps: sigma_G, noise of one gyro sample.
        sigma_accel_mps2: sigma_A, noise of one accelerometer sample; null: 0.02 when adaptive, 2.0 with none.
        external_memory: c_a, from 0 to 1. With 1 the absolute tilt is not observable; lee needs more than 0.
        window: mu, samples in the mean of mtf, this one included.
        normalise: bring x back to length 1 after each update.
        propagation: first_order, or exact for fast rotation.
        initial_tilt_variance: diagonal of the first P; null: 1e-3 at rest or by the track, .03 moving.
    """

    name: ClassVar[str] = "tilt"

    adapt: str = "mtf"
    sigma_gyro_radps: float = 0.0017
    sigma_accel_mps2: float | None = None
    external_memory: float = 0.0
    window: int = 1
    normalise: bool = True
    propagation: str = "first_order"
    initial_tilt_variance: float | None = None

    def __post_init__(self) -> None:
        """Check that every choice exists and every number makes sense."""
        super().__post_init__()
        self._check_choices({"adapt": ADAPTATIONS, "propagation": PROPAGATIONS})
        self._check_numbers()

    def verticals(self, recording: Recording) -> Verticals:
        """Return x after each sample, and whether it triggered."""
        imu, start = recording.inertial, align(recording, self.initial_tilt_variance, self.alignment)
        return run_tilt(start, imu.gyro_radps, imu.accel_mps2, intervals(imu), self.tilt_parameters())

    def tilt_parameters(self) -> TiltParameters:
        """Return the parameters of a tilt step, the null ones filled in."""
        sigma = self.sigma_accel_mps2
        if sigma is None:
            sigma = 2.0 if self.adapt == "none" else 0.02
        return TiltParameters(
            sigma_gyro_radps=self.sigma_gyro_radps,
            sigma_accel_mps2=sigma,
            external_memory=self.external_memory,
            window=self.window,
            normalise=self.normalise,
            exact=self.propagation == "exact",
            adapt=self.adapt,
        )

    def _check_numbers(self) -> None:
        for name in ("sigma_accel_mps2", "initial_tilt_variance"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise PluginError(f"attitude tilt: {name} is {value}; it must be a positive number.")
        require_not_negative("attitude tilt", self, ("sigma_gyro_radps",))
        if not 0 <= self.external_memory <= 1:
            raise PluginError(f"attitude tilt: external_memory is {self.external_memory}; it must be from 0 to 1.")
        if self.window < 1:
            raise PluginError(f"attitude tilt: window is {self.window}; it must be at least 1.")
        if self.adapt == "lee" and self.external_memory == 0:
            raise PluginError("attitude tilt: adapt lee with external_memory 0 never adapts; set external_memory.")
