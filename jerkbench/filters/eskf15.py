"""The error-state inertial navigation that practitioners run, and the smoother over it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate, Streamed
from jerkbench.filters.common import of_r_alone
from jerkbench.filters.inertial_parameters import Eskf15Parameters, aided, run_inputs, takes_timeline
from jerkbench.inertial.run import InertialRun, InertialSolution
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.smoother import smooth_navigation
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Timeline


class InertialFilter(Eskf15Parameters):
    """What the filters with the parts and the parameters of `eskf15` share; in NumPy, but for what is compiled."""

    invariant: ClassVar[bool] = False

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the adaptations that it accepts: all that change R alone."""
        return of_r_alone()

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the recording of ``load`` has the wheel whose scale was asked for.

        Raises:
            RecordingError: it has not.
        """
        if self.wheel_scale:
            aided(self, load())

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        return self.solve(recording, attitude, adaptation).estimate

    def solve(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> InertialSolution:
        """Return the navigation solution with the state and the whole covariance at the end."""
        journey = self.journey(recording, attitude)
        return InertialRun(journey, adaptation).over(journey.events)

    def journey(self, recording: Recording, attitude: Attitude, timeline: Timeline | None = None) -> Journey:
        """Return everything that a run needs besides its adaptation, as `run_inputs` says."""
        return run_inputs(self, recording, attitude, timeline)


@register("filter", "eskf15")
@dataclass(frozen=True)
class Eskf15(InertialFilter):
    """Error-state inertial navigation with 15 states: position, velocity, attitude, gyro and accelerometer bias.

    Unlike the kinematic filters it integrates the raw IMU itself, so that position and velocity correct the attitude
    too. Nominal state, from the mean force y_A and rate y_G of a sample, C the attitude (body -> ENU)::

        w = y_G - b_g,  f = y_A - b_a
        C+ = Exp(-w_e dt) C Exp(w dt),  C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt,  p+ = p + (v + v+)/2 dt

    Error state dx = [dp, dv, phi, db_g, db_a], truth less estimate, true C = Exp(phi) C::

        dp' = dv,  dv' = -[C f] phi - C db_a + n_a,  phi' = -C db_g + n_g,  db' = n_b
        P = Phi P Phi' + Q;  density of n_b: 2 sigma^2/tau
        K = P H' (H P H' + R)^-1;  dx = K (z - h(x)), put into the nominal state;  P in Joseph form

    A bias walks as a Gauss-Markov process of sigma and tau does over times below tau; it is not drawn back to zero,
    because the turn-on bias, which is in the same state, is not. A correction, and P with it, keeps the force that
    holds the body up as the linear filter says (`jerkbench.inertial.state.corrected`): levelling hides an accelerometer
    bias in the tilt, and the turn that tells them apart would else leave g phi^2/2 in the vertical.

    Measurements, at their own times, l a lever arm::

        position (antenna)      p + C l
        velocity, ENU           v + C (w x l)          body: C' v (of the IMU)
        wheel's speed           (1 + k) (C' v + w x l)_x, and (C' v + w x l)_yz where it is said to be zero
        heading                 atan2(C_21, C_11)
        zero velocity           v = 0                  when IMU and estimate agree that it stands still
        non-holonomic           (C' v + w x l)_yz = 0  when it does not

    Start: at rest, roll and pitch from the first second of specific force (with the error that an accelerometer bias
    makes of it), v = 0; moving, from the attitude filter. Yaw is the attitude filter's at the start (before its first
    course: that one less the integrated gyro), with the sigma that it has there, or that of the track of the fixes. The
    attitude filter is used for nothing else. Wrong by a right angle or more, the filter may never recover.

    Neglected: the Earth's rotation and curvature unless switched on (in a fixed tangent plane there is no transport
    rate; what is left is that gravity turns, .16 mrad a km), the change of gravity with latitude (a bias takes it),
    coning and sculling within a sample, and the latency of a receiver. It has no states for scale factors and
    misalignments of the IMU. With such an IMU it is overconfident; raise its noise or its turn-on biases. The error k
    of a wheel's scale is zero, or with ``wheel_scale`` one more state, constant. Good where the vehicle turns and
    accelerates, which makes yaw and biases observable, and in outages of up to a minute; it needs an IMU whose data
    sheet is known.

    Rows that an adaptation sees are those of position and velocity (in the velocity's own frame); headings and
    constraints are not adapted, and not among the recorded updates. It takes every adaptation that changes R alone.

    The engine `filterpy` runs all of this in NumPy, a step at a time: the definition of right. The engine `compiled`
    runs the same by the blocks of Phi that are not zero, compiled, and agrees to 1e-9 m, and to 1e-12 of
    sqrt(P_ii P_jj) or what the run itself makes of changes in the last bits of its input.

    Source: P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed.,
    chapters 5 and 14, reduced to a tangent plane.
    """

    provenance = Provenance(
        "simplified",
        "Groves, 2nd ed., chapters 5 and 14",
        "In a tangent plane; the Earth turns only where switched on.",
    )

    title: ClassVar[str] = "eskf15"

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same as `estimate`; None where numba cannot compile the adaptation."""
        from jerkbench.inertial.compiled_runs import solve_compiled  # what it imports takes half a second

        solution = solve_compiled(_journey(self, recording, attitude), adaptation)
        return None if solution is None else solution.estimate

    def run_settings(
        self,
        runs: Sequence[RecordedRun],
        estimators: "Sequence[Eskf15]",
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        attitude: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, with its own of ``estimators`` and ``adaptations``.

        Runs of like steps go side by side.
        """
        from jerkbench.inertial.compiled_runs import stream_journeys

        def journey(k: int) -> Journey | None:
            model, run = estimators[k], runs[k]
            try:
                if takes_timeline(model, run.reported):
                    return _journey(model, run.reported, run.attitude, run.timeline)
                return _journey(model, run.recording, run.attitude)
            except Exception:  # noqa: BLE001 - whoever runs it alone sees it
                return None

        scorings, journeys = [run.scoring for run in runs], [journey(k) for k in range(len(runs))]
        return stream_journeys(journeys, scorings, adaptations, updates=updates, attitude=attitude, threads=threads)


@lru_cache(maxsize=32)  # as many as a process keeps recordings; for the next adaptation
def _journey(model: Eskf15, recording: Recording, attitude: Attitude, timeline: Timeline | None = None) -> Journey:
    return model.journey(recording, attitude, timeline)


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
