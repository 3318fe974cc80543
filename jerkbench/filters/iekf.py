"""The invariant inertial navigation: eskf15's parts with the error on the group SE_2(3)."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.filters.eskf15 import Eskf15
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("filter", "iekf")
@dataclass(frozen=True)
class InvariantEkf(Eskf15):
    """Inertial navigation by a right-invariant extended Kalman filter on SE_2(3), with both biases.

    The nominal state, the measurements, the start and every parameter are those of `eskf15`. The error is not a
    difference but a group element, truth X over estimate Xh::

        X = [[C, v, p], [0, 1, 0], [0, 0, 1]];  eta = X Xh^-1 = Exp(xi);  xi = [phi, rho, pi]

    Without biases and noise it grows by the same linear equation on every trajectory, however large it is
    ("log-linear"): [g] is the cross product with gravity, and no estimate is in it::

        phi+ = phi;  rho+ = rho + dt [g] phi;  pi+ = pi + dt rho + dt^2/2 [g] phi

    Biases, and scale factors where they are states, stay additive ("imperfect" IEKF); their columns hold the estimate::

        phi' = -Ch db_g;  rho' = [g] phi - [vh] Ch db_g - Ch db_a;  pi' = rho - [ph] Ch db_g

    To the first order xi = T dx is eskf15's error dx in other numbers, rho = dv + [vh] phi and pi = dp + [ph] phi. The
    covariance is kept in those of dx, where Phi, Q and H are eskf15's own; a long way from the origin no digits are
    lost to [ph]. Two things differ, both after an update with dx = K y and J the left Jacobian of phi::

        C+ = Exp(phi) Ch;  v+ = vh + J dv;  p+ = ph + J dp            this is Xh+ = Exp(xi) Xh
        dp+ = dp - [p+ - p] phi;  dv+ = dv - [v+ - v] phi             the covariance of xi stays as it is

    Both are of the second order: while the attitude is known to some degrees, iekf and eskf15 are the same filter. Six
    drives of 14 s on `field_white` without a heading, whose first yaw is wrong by as much as it says; the yaw's error
    at the end, the worst, and NEES of position and velocity from 8 s on (6 expected), the median::

        first yaw wrong by      11      34      69     115 degrees
        eskf15, yaw [deg]      0.5     0.8     6.5     116         NEES  6.8   6.7   7.3   36
        iekf,   yaw [deg]      0.6     0.8     1.2     5.8         NEES  7.7   7.9   8.4   31

    An accelerometer bias is added as it comes. eskf15 changes it so that the force that holds the body up stays what
    the linear filter says, which counts where biases are large: NEES of position and velocity after 36 s, 20 drives
    (band 4.6 to 7.6), is 8.1 with the IMU ``consumer`` (20 mg) and 5.0 with ``tactical``; eskf15's are 5.5 and 5.0.

    Left out: the Earth's turning in Phi, as in eskf15; with it the error is no longer exactly autonomous. Position and
    velocity are left-invariant observations: with this right-invariant error their H holds the estimate.

    The engine `filterpy` runs it in NumPy, the definition of right, `compiled` the same compiled.

    Source: A. Barrau, S. Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE Transactions on
    Automatic Control 62(4), 2017, doi:10.1109/TAC.2016.2594085; biases and discrete time: R. Hartley, M. Ghaffari,
    R. M. Eustice, J. W. Grizzle, "Contact-aided invariant extended Kalman filtering for robot state estimation", The
    International Journal of Robotics Research 39(4), 2020, doi:10.1177/0278364919894385. Neither recommends sensor
    noise: the defaults are eskf15's.
    """

    provenance = Provenance(
        "simplified",
        "doi:10.1109/TAC.2016.2594085",
        "Biases are additive; the error's equation leaves out the Earth's turning.",
    )

    title: ClassVar[str] = "iekf"
    invariant: ClassVar[bool] = True
