"""Inertial navigation filters: the error-state and the invariant extended Kalman filter, and a smoother."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate, Streamed
from jerkbench.filters.common import AdaptedR
from jerkbench.filters.inertial_parameters import Eskf15Parameters, aided, run_inputs, takes_timeline
from jerkbench.inertial.run import InertialRun, InertialSolution, smooth_navigation
from jerkbench.inertial.run_inputs import InertialInputs
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Timeline


class InertialFilter(Eskf15Parameters, AdaptedR):
    """Base class of the inertial filters that have the parameters of `eskf15` and run in NumPy."""

    invariant: ClassVar[bool] = False

    def require(self, load: Callable[[], Recording]) -> None:
        """Load the recording and check that it has the wheel speed that ``wheel_scale`` needs.

        The check runs before a sweep starts. Without ``wheel_scale``, the recording is not loaded.

        Raises:
            RecordingError: ``wheel_scale`` is set, but the recording has no wheel speed.
        """
        if self.wheel_scale:
            aided(self, load())

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the time stamps of the reference."""
        return self.solve(recording, attitude, adaptation).estimate

    def solve(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> InertialSolution:
        """Return the navigation solution, including the final nominal state and the full covariance of its error."""
        return InertialRun(self.inputs(recording, attitude), adaptation).solve()

    def inputs(self, recording: Recording, attitude: Attitude, timeline: Timeline | None = None) -> InertialInputs:
        """Return the inputs of a run except the adaptation. The arguments are the same as in `run_inputs`."""
        return run_inputs(self, recording, attitude, timeline)


@register("filter", "eskf15")
@dataclass(frozen=True)
class Eskf15(InertialFilter):
    """Error-state inertial navigation with 15 states: position, velocity, attitude, gyro and accelerometer bias.

    Unlike the kinematic filters, this filter integrates the raw IMU data, so that measured positions and velocities
    also correct the attitude. The nominal state is propagated with the mean specific force y_A and the mean angular
    rate y_G of each IMU sample. C is the rotation matrix from the body frame to ENU, g is gravity, and w_e is the
    angular rate of the Earth::

        w = y_G - b_g,  f = y_A - b_a
        C+ = Exp(-w_e dt) C Exp(w dt),  C_mean = (C + C+)/2
        v+ = v + (C_mean f + g(p) - 2 w_e x v) dt,  p+ = p + (v + v+)/2 dt

    The error state dx = [dp, dv, phi, db_g, db_a] is the truth minus the estimate. The true attitude is Exp(phi) C::

        dp' = dv,  dv' = -[C f] phi - C db_a + n_a,  phi' = -C db_g + n_g,  db' = n_b
        P = Phi P Phi' + Q;  density of n_b: 2 sigma^2/tau
        K = P H' (H P H' + R)^-1;  dx = K (z - h(x)), applied to the nominal state;  P in Joseph form

    Each sensor bias is modelled as a random walk, which approximates a Gauss-Markov process with the parameters sigma
    and tau over times shorter than tau. The estimated bias does not decay to zero, because it includes the constant
    turn-on bias. A correction of tilt and accelerometer bias is applied such that the vertical specific force is equal
    to the estimate of the linear filter (`jerkbench.inertial.state.corrected`). Without this choice of the bias
    correction, a large tilt correction phi would leave an error of g phi^2/2 in the vertical acceleration.

    Each measurement is used at its time stamp. The predicted measurements are as follows, where l is a lever arm::

        position (antenna)      p + C l
        velocity, ENU           v + C (w x l)          body: C' v (of the IMU)
        wheel speed             (1 + k) (C' v + w x l)_x, and (C' v + w x l)_yz if the recording says that it is zero
        heading                 atan2(C_21, C_11)
        zero velocity           v = 0                  if IMU and estimate both indicate that the vehicle is stationary
        non-holonomic           (C' v + w x l)_yz = 0  otherwise

    If the vehicle is at rest at the start, the initial velocity is 0, and the initial roll and pitch are computed from
    the specific force of the first second. The initial covariance includes the tilt error that an accelerometer bias
    causes. If the vehicle moves at the start, the attitude filter computes the initial roll and pitch. The initial yaw
    and its sigma are computed by the attitude filter or from the track of the position fixes. Before its first
    course measurement, the attitude filter computes the yaw backwards from this course with the integrated gyro. The
    attitude filter affects only the initial state of `eskf15`. If the initial yaw is wrong by 90 degrees or more, the
    filter may never recover.

    By default, the filter neglects the Earth's rotation and curvature. Due to the curvature, the direction of gravity
    changes by 0.16 mrad per km. The filter always neglects the change of gravity with latitude, which has the same
    effect as an accelerometer bias. The filter also neglects coning and sculling within a sample, and the latency of
    the receiver. The filter has no states for scale factors and misalignments of the IMU. If the IMU has such errors,
    the filter is overconfident, and the noise densities or the standard deviations of the turn-on biases should be
    increased. The scale error k of the wheel speed is zero by default. With ``wheel_scale``, the scale error k is an
    additional constant state. The filter works well in outages of up to a minute. Turns and accelerations of the
    vehicle make the yaw and the biases observable. The noise of the IMU must be known, for example from its data sheet.

    An adaptation receives the innovations of position and velocity. The velocity rows of the innovation are in the
    frame of the measured velocity. The updates with headings and motion constraints are neither adapted nor recorded.
    All adaptations that change only R are supported.

    The engine `filterpy` runs the reference implementation of the filter in NumPy. The engine `compiled` runs compiled
    code that uses only the nonzero blocks of Phi. The states of the two engines agree to 1e-9 m. The covariances of the
    two engines agree to 1e-12 of sqrt(P_ii P_jj), or to the difference that a change in the last bits of the input
    causes.

    Source: P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed.,
    chapters 5 and 14, reduced to a tangent plane.
    """

    provenance = Provenance(
        "simplified", "Groves, 2nd ed., chapters 5 and 14", "In a tangent plane; the Earth's rotation is optional."
    )

    title: ClassVar[str] = "eskf15"

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same result as `estimate`, computed by compiled code.

        Return None if numba cannot compile the adaptation, or if the adaptation raises an error.
        """
        from jerkbench.inertial.compiled_runs import solve_compiled  # importing this module takes half a second

        solution = solve_compiled(_cached(self, recording, attitude), adaptation)
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
        """Run each run k with ``estimators[k]`` and ``adaptations[k]``, and return the error sums of each run.

        Runs with the same time steps are computed in one batch.
        """
        from jerkbench.inertial.compiled_runs import run_many_inertial

        def inputs(k: int) -> InertialInputs | None:
            model, run = estimators[k], runs[k]
            try:
                if takes_timeline(model, run.reported):
                    return _cached(model, run.reported, run.attitude, run.timeline)
                return _cached(model, run.recording, run.attitude)
            except Exception:  # noqa: BLE001 - the run is repeated separately and then raises the error again
                return None

        scorings, every = [run.scoring for run in runs], [inputs(k) for k in range(len(runs))]
        return run_many_inertial(every, scorings, adaptations, updates=updates, attitude=attitude, threads=threads)


@lru_cache(maxsize=32)  # the number of recordings in the cache; the runs of all adaptations have the same inputs
def _cached(
    model: Eskf15, recording: Recording, attitude: Attitude, timeline: Timeline | None = None
) -> InertialInputs:
    return model.inputs(recording, attitude, timeline)


@register("filter", "eskf15_rts")
@dataclass(frozen=True)
class Eskf15Smoother(InertialFilter):
    """The Rauch-Tung-Striebel smoother over `eskf15`: every estimate uses all measurements, including later ones.

    The forward pass runs `eskf15` with the same parameters and adaptation. A node is a time step that ends with a
    measurement or at a time stamp of the reference. The prior x- and P- are the state and its covariance before the
    measurements of a node. The posterior x+ and P+ are the state and its covariance after the measurements. The matrix
    Phi propagates the error state from one node to the next node. Every correction is applied to the nominal state
    immediately, so the mean of the error state is zero before each update. The backward pass starts at the last node.
    The difference x (-) y is the error state that transforms y into x, and P' is the smoothed covariance, transformed
    to the error about x-::

        G = P+ Phi' (P-_{k+1})^-1
        xs = x+ corrected by G (xs_{k+1} (-) x-_{k+1})
        Ps = P+ + G (P'_{k+1} - P-_{k+1}) G'

    In an outage, the smoother uses the measurements before and after the outage. The smoother estimates the initial yaw
    from all measurements of the drive. The smoother cannot be used online, and it does not correct a wrong model. The
    reported innovations, NIS and adapted covariances are computed in the forward pass. The smoother is linearised about
    the states of the forward pass. If the forward pass diverges, or if its attitude is wrong by tens of degrees, the
    smoothed solution is also wrong.

    The smoother always runs in NumPy, also with the engine `compiled`. The smoother stores every node, which needs 6 kB
    of memory per node with 15 states. A run of 150 s with a reference at 100 Hz needs 80 MB of memory.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal
    3(8), 1965, doi:10.2514/3.3166; smoothing of the error state of an inertial navigation: P. D. Groves, "Principles of
    GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed., section 3.4.5.
    """

    provenance = Provenance("simplified", "doi:10.2514/3.3166", "Over `eskf15`, linearised about its forward pass.")

    title: ClassVar[str] = "eskf15_rts"

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the smoothed estimate at the time stamps of the reference, up to a divergence of the forward pass."""
        return smooth_navigation(self.inputs(recording, attitude), adaptation)


@register("filter", "iekf")
@dataclass(frozen=True)
class InvariantEkf(Eskf15):
    """Inertial navigation with a right-invariant extended Kalman filter on SE_2(3), with gyro and accelerometer biases.

    The nominal state, the measurements, the initialisation and all parameters are the same as in `eskf15`. The error is
    not a difference but an element eta of the group SE_2(3). X is the true state and Xh is the estimate::

        X = [[C, v, p], [0, 1, 0], [0, 0, 1]];  eta = X Xh^-1 = Exp(xi);  xi = [phi, rho, pi]

    Without biases and noise, an error of any size follows the same linear equation on every trajectory (the log-linear
    property). The linear equation of the error does not contain the estimate. [g] is the cross-product matrix of
    gravity::

        phi+ = phi;  rho+ = rho + dt [g] phi;  pi+ = pi + dt rho + dt^2/2 [g] phi

    The errors of the biases and of an estimated wheel scale are additive, as in the "imperfect" IEKF. The derivatives
    with respect to the bias errors contain the estimate::

        phi' = -Ch db_g;  rho' = [g] phi - [vh] Ch db_g - Ch db_a;  pi' = rho - [ph] Ch db_g

    To first order, xi = T dx is a linear transformation of the error dx of `eskf15`, with rho = dv + [vh] phi and pi =
    dp + [ph] phi. The filter stores the covariance of dx, for which Phi, Q and H are the same as in `eskf15`. The
    covariance of xi would be inaccurate far from the origin, because [ph] is large there. After an update with dx = K
    y, the correction and the reset of the covariance differ from `eskf15`. J is the left Jacobian of phi::

        C+ = Exp(phi) Ch;  v+ = vh + J dv;  p+ = ph + J dp            equivalent to Xh+ = Exp(xi) Xh
        dp+ = dp - [p+ - p] phi;  dv+ = dv - [v+ - v] phi             the covariance of xi does not change

    The differences between `iekf` and `eskf15` are of second order in the error. If the attitude is known to a few
    degrees, `iekf` and `eskf15` give nearly the same result. The following table compares both filters for different
    errors of the initial yaw. In each column of the table, the sigma of the initial yaw is equal to the error of the
    initial yaw. The table is based on 6 drives of 14 s of `field_white` without a heading. The table lists the largest
    yaw error at the end of a drive, and the median NEES of position and velocity from 8 s on, whose expected value is
    6::

        initial yaw error       11      34      69     115 degrees
        eskf15, yaw [deg]      0.5     0.8     6.5     116         NEES  6.8   6.7   7.3   36
        iekf,   yaw [deg]      0.6     0.8     1.2     5.8         NEES  7.7   7.9   8.4   31

    `iekf` adds the estimated error of the accelerometer bias unchanged. `eskf15` modifies the estimated error of the
    accelerometer bias so that the vertical specific force is equal to the estimate of the linear filter. This
    modification of the bias correction matters if the accelerometer bias is large. With the IMU ``consumer`` (20 mg),
    the NEES of position and velocity after 36 s is 8.1 for `iekf` and 5.5 for `eskf15` (20 drives, 95 % band 4.6 to
    7.6). With the IMU ``tactical``, the NEES of position and velocity is 5.0 for both filters.

    As in `eskf15`, Phi does not include the Earth's rotation, because the error equation with the Earth's rotation
    would not be exactly autonomous. Position and velocity are left-invariant observations, so the matrix H contains the
    estimate.

    The engine `filterpy` runs the reference implementation in NumPy. The engine `compiled` runs the same equations in
    compiled code.

    Source: A. Barrau, S. Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE Transactions on
    Automatic Control 62(4), 2017, doi:10.1109/TAC.2016.2594085; biases and discrete time: R. Hartley, M. Ghaffari, R.
    M. Eustice, J. W. Grizzle, "Contact-aided invariant extended Kalman filtering for robot state estimation", The
    International Journal of Robotics Research 39(4), 2020, doi:10.1177/0278364919894385. Neither paper recommends
    values of the sensor noise; the default values are the same as in `eskf15`.
    """

    provenance = Provenance(
        "simplified",
        "doi:10.1109/TAC.2016.2594085",
        "Biases are additive; the error equation neglects the Earth's rotation.",
    )

    title: ClassVar[str] = "iekf"
    invariant: ClassVar[bool] = True
