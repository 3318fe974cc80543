"""The smoother over the inertial navigation: what hindsight could reach with the IMU."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import InertialFilter
from jerkbench.inertial.smoother import smooth_navigation
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("filter", "eskf15_rts")
@dataclass(frozen=True)
class Eskf15Smoother(InertialFilter):
    """The Rauch-Tung-Striebel smoother over `eskf15`: every estimate knows all measurements, later ones too.

    Forward it is eskf15 with the adaptation and with every parameter of it. A node is a step at which something is
    taken or given out; x-, P- are state and covariance before what is taken there, x+, P+ after it, Phi leads from node
    to node. Every correction goes into the nominal state at once, so the error of x- is zero; backward from the last
    node, with x (-) y the error state that takes y to x, and P' the covariance Ps in the numbers of the prior::

        G = P+ Phi' (P-_{k+1})^-1
        xs = x+ with G (xs_{k+1} (-) x-_{k+1}) put into it
        Ps = P+ + G (P'_{k+1} - P-_{k+1}) G'

    An outage is bridged from both of its ends, and the first yaw is found from all of the drive. It is of no use while
    driving; a wrong model stays wrong in hindsight; innovations, NIS and adapted covariances are those of the forward
    pass. It is linearised about the forward pass: where that is lost or off by tens of degrees, so is this.

    It runs in NumPy with either engine, and keeps every node: 6 kB each with 15 states, 80 MB for 150 s with a
    reference at 100 Hz.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
    Journal 3(8), 1965, doi:10.2514/3.3166; over the errors of a navigation: P. D. Groves, "Principles of GNSS,
    Inertial, and Multisensor Integrated Navigation Systems", 2nd ed., section 3.4.5.
    """

    provenance = Provenance("simplified", "doi:10.2514/3.3166", "Over `eskf15`, linearised about its forward pass.")

    title: ClassVar[str] = "eskf15_rts"

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the smoothed solution at the reference's stamps; where the forward pass stops, up to there."""
        return smooth_navigation(self.journey(recording, attitude), adaptation)
