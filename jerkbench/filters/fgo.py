"""The factor graph on GTSAM: the yardstick that papers use."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import InertialFilter
from jerkbench.filters.inertial_parameters import DEFORMATION
from jerkbench.inertial.factor_graph import Graph, Options, batch, estimate_of, fixed_lag
from jerkbench.inertial.smoother import forward_states
from jerkbench.parameters import ABOVE_ZERO, DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording

LOSSES = ("none", "huber", "cauchy", "switchable")
NOT_TAKEN = (*DEFORMATION, "wheel_scale", "zero_velocity", "nonholonomic", "earth_rotation", "earth_curvature")
LAG = Limit(lambda lag: lag >= 0, "give 0 (all) or more.")
ONCE = Limit(lambda count: count >= 1, "give 1 or more.")


@register("filter", "fgo")
@dataclass(frozen=True)
class FactorGraph(InertialFilter):
    """Inertial navigation as a factor graph on GTSAM, over the whole drive or its last seconds, robust on request.

    A node for each time of a measurement: pose, velocity, biases. The graph minimises, with r whitened residuals::

        |r_start|^2/2 + sum |r_imu|^2/2 + sum rho(|r_fix|) + sum rho(|r_velocity|) + sum r_heading^2/2
        none        rho = r^2/2
        huber       rho = r^2/2 up to k, k (r - k/2) beyond
        cauchy      rho = k^2/2 log(1 + r^2/k^2)
        switchable  rho = (s r)^2/2 + k^2 (s - 1)^2/2, each fix and each velocity with an s of its own

    r_imu is GTSAM's CombinedImuFactor: all samples between two nodes, preintegrated, with the walk of the biases. The
    start, with all of its correlations, the noise of the sensors and the measurements are those of `eskf15`.

    ``lag_s`` 0 optimises the whole drive at once (Levenberg-Marquardt, from the states of eskf15's forward pass): a
    smoother, of no use while driving. Otherwise each node is what the last ``lag_s`` seconds know of it, older ones
    being marginalised: what a filter with that much memory, which linearises again, could say. Between two nodes the
    estimate is carried on from the one before, by eskf15's equations, covariance too.

    A switch s is one more unknown of the graph, 1 at first, drawn to 1 with sigma 1/k (the paper's Xi, which is 1
    there). At the optimum it is k^2/(k^2 + r^2), which the paper's clamp to [0, 1] would not change: the places are
    those of the loss of Geman and McClure. The covariance has the switches' own share in it.

    The losses are its adaptations: it takes no other. Headings are used as eskf15 uses them, without a loss. A fix, or
    a velocity, of which an axis is absent is not used. It needs a velocity in ENU, or none; no scale factors, no
    constraints, a plane that does not turn. On a busy machine it made 120 nodes a second over a whole drive, and 4 with
    a lag of 5 s. Switches are GTSAM's CustomFactor, a call of Python each: over a whole drive of 40 nodes .17 to .25 s
    of processor time where Huber's loss took .07, with a lag of 2 s no more than it.

    Source: C. Forster, L. Carlone, F. Dellaert, D. Scaramuzza, "On-manifold preintegration for real-time
    visual-inertial odometry", IEEE Transactions on Robotics 33(1), 2017, doi:10.1109/TRO.2016.2597321; the switches:
    N. Suenderhauf, P. Protzel, "Switchable constraints for robust pose graph SLAM", IROS 2012,
    doi:10.1109/IROS.2012.6385590; GTSAM 4.3 by F. Dellaert and contributors (BSD), the extra ``fgo``.

    Attributes:
        loss: rho of fixes and velocities: none, huber, cauchy or switchable.
        loss_scale: k, in sigmas of all three axes together.
        lag_s: how much of the drive is kept; 0: all of it [s].
        iterations: most of the whole drive's optimisation.
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TRO.2016.2597321", "Fixes and velocities in place of vision; all else is GTSAM's."
    )

    title: ClassVar[str] = "fgo"
    not_taken: ClassVar[tuple[str, ...]] = NOT_TAKEN

    loss: str = "none"
    loss_scale: Annotated[
        float,
        ABOVE_ZERO,
        Range(0.5, 20.0, log=True, source="ours: from half of a three-axis residual's mean to where none is left"),
        DefaultOrigin("literature: Huber's 95 % efficiency for one axis, GTSAM's default"),
    ] = 1.345
    lag_s: Annotated[float, LAG, DefaultOrigin("off: the whole drive")] = 0.0
    iterations: Annotated[int, ONCE, DefaultOrigin("GTSAM's default")] = 100

    def __post_init__(self) -> None:
        """Check the ranges, and that nothing is asked for that it has not."""
        super().__post_init__()
        require_known("loss of filter fgo", self.loss, LOSSES)
        if any(self.reference_point_m) or (any(self.antenna_m) and self.use_velocity):
            raise PluginError("fgo takes antenna_m with use_velocity=false only, and gives out the IMU's place.")

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the adaptations that it accepts: none; its loss stands in their place."""
        return ("none",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps.

        Raises:
            RecordingError: the velocity is not in ENU.
            PluginError: GTSAM is not installed.
        """
        journey = self.journey(recording, attitude)
        if journey.settings.velocity_frame != "enu":
            raise RecordingError(
                f"{recording.name}: fgo needs a velocity in ENU, and this one is {journey.settings.velocity_frame};"
                " set use_velocity=false."
            )
        graph = Graph(journey, Options(self.loss, self.loss_scale, self.lag_s, self.iterations))
        if self.lag_s > 0.0:
            return estimate_of(journey, graph.nodes, list(fixed_lag(graph)))
        initial = forward_states(journey, adaptation, graph.nodes)
        return estimate_of(journey, graph.nodes, list(batch(graph, initial.__getitem__)))
