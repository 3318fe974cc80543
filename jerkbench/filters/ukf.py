"""The unscented inertial navigation: filterpy's UKF over the error state of eskf15."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import InertialFilter
from jerkbench.filters.inertial_parameters import DEFORMATION
from jerkbench.inertial.unscented import UnscentedRun
from jerkbench.parameters import DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

LITERATURE = "literature: Wan and van der Merwe 2000 for a Gaussian prior"


MINUS_STATES = Limit(lambda kappa: kappa > -15.0, "it must be above -15, minus the number of states.")


@register("filter", "ukf")
@dataclass(frozen=True)
class Ukf(InertialFilter):
    """Inertial navigation by an unscented Kalman filter over the error state, attitudes as rotation vectors.

    The nominal state, the measurements, the start and the parameters are those of `eskf15`; scale factors, a wheel's
    scale and the Earth's turning and curvature it has not. In the place of Phi and H stand sigma points, of n = 15::

        dx_0 = 0,  dx_i = +-row i of the Cholesky factor of (n + lambda) P;  lambda = alpha^2 (n + kappa) - n
        weights: W_0 = lambda/(n + lambda) (for P: + 1 - alpha^2 + beta), else 1/(2 (n + lambda))

    Each dx_i is put into the nominal state (C_i = Exp(phi_i) C, the rest is added), carried over every sample of the
    IMU by the mechanisation itself, and taken back as an error about sigma point 0, phi_i as the rotation vector of
    C_i C_0'. Mean and covariance are filterpy's unscented transform, plus the Q of eskf15. An update is filterpy's too,
    with h(x) of each sigma point; its mean goes into the nominal state at once, and P is taken again about the new one.

    Where the attitude is known to some degrees it is eskf15 with more work; it has no derivative to be wrong, and sees
    the second order of a large first yaw. It takes every adaptation that changes R alone.

    It is slow, because filterpy makes its sigma points one after the other: some thirty times slower than the NumPy way
    of eskf15, a thousand times slower than the compiled one, with either engine. A run that lasts longer than ten
    seconds says every ten how far it has come.

    Source: E. A. Wan, R. van der Merwe, "The unscented Kalman filter for nonlinear estimation", AS-SPCC 2000,
    doi:10.1109/ASSPCC.2000.882463; attitude errors as the state: J. L. Crassidis, F. L. Markley, "Unscented filtering
    for spacecraft attitude estimation", Journal of Guidance, Control, and Dynamics 26(4), 2003, doi:10.2514/2.5102;
    filterpy 2 by R. R. Labbe (MIT).

    Attributes:
        alpha: how far out the sigma points lie, as a part of sqrt(n + kappa) sigmas.
        beta: of the prior's fourth moment; 2 is a Gaussian's.
        kappa: shifts weight to sigma point 0.
    """

    provenance = Provenance("simplified", "doi:10.1109/ASSPCC.2000.882463", "Over the error state of `eskf15`.")

    title: ClassVar[str] = "ukf"
    not_taken: ClassVar[tuple[str, ...]] = (*DEFORMATION, "wheel_scale", "earth_rotation", "earth_curvature")

    alpha: Annotated[
        float,
        Limit(lambda alpha: 0.0 < alpha <= 1.0, "it must be above 0 and at most 1."),
        Range(0.01, 1.0, log=True, source="the paper: 1e-4 to 1; below .01 a double has too few digits"),
        DefaultOrigin("ours: within the paper's 1e-4 to 1, with digits to spare"),
    ] = 0.1
    beta: Annotated[float, DefaultOrigin(LITERATURE)] = 2.0
    kappa: Annotated[float, DefaultOrigin(LITERATURE), MINUS_STATES] = 0.0

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        from filterpy.kalman import MerweScaledSigmaPoints  # a second, because it imports pyplot

        points = MerweScaledSigmaPoints(15, self.alpha, self.beta, self.kappa)
        journey = self.journey(recording, attitude)
        return UnscentedRun(journey, adaptation, points).over(journey.events).estimate
