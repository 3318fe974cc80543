"""The error-state inertial navigation that practitioners run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.assembly import filtered_yaw
from jerkbench.attitude.headings import required_track
from jerkbench.checks import require_not_negative
from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, RecordingError, unknown
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters._accepted import of_r_alone
from jerkbench.inertial.alignment import StartSigmas, align, with_body_velocity
from jerkbench.inertial.earth import earth_at
from jerkbench.inertial.error_model import SensorNoise
from jerkbench.inertial.events import merge_events
from jerkbench.inertial.run import Constraints, InertialRun, InertialSolution, Settings
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.state import NavigationState
from jerkbench.inertial.stillness import still_samples
from jerkbench.optional import wants_truth
from jerkbench.parameters import Origin, Range
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Recording
from jerkbench.streamed_run import RecordedRun, Streamed
from jerkbench.timeline.timeline import Timeline, build_timeline

if TYPE_CHECKING:
    from jerkbench.inertial.compiled.solution import Prepared  # what it imports takes half a second

YAW_SOURCES = ("attitude", "track")

YAW_WALK = 2e-4
"""Random walk of the yaw of the track [rad/sqrt(s)]; the attitude filters' own default."""

COURSE_SIGMA_RAD = 0.0087
"""Least sigma of a course of the track; the attitude filters' own default."""

DEG_PER_H = np.deg2rad(1.0) / 3600.0
PER_SQRT_H = 1.0 / 60.0
MG = 1e-3 * GRAVITY_MPS2

GRADES = "ours: from a tactical sensor to a phone's on a vibrating vehicle"

INSTABILITIES = ("gyro_instability_deg_per_h", "accel_instability_mg")
SIGMAS = (
    *("angle_random_walk_deg_per_sqrt_h", "velocity_random_walk_mps_per_sqrt_h", *INSTABILITIES),
    *("gyro_turn_on_deg_per_h", "accel_turn_on_mg", "initial_yaw_sigma_rad"),
    *("zero_velocity_sigma_mps", "nonholonomic_sigma_mps", "wheel_scale_sigma"),
)
POSITIVE = (
    *(name for name in SIGMAS if name not in INSTABILITIES),
    *("gyro_correlation_s", "accel_correlation_s", "track_least_m"),
    *("constraint_interval_s", "still_window_s", "still_accel_mps2", "still_gyro_radps", "still_below_mps"),
)
DEFORMATION = ("gyro_scale_ppm", "accel_scale_ppm", "misalignment_mrad")
ARMS = ("antenna_m", "nonholonomic_point_m", "reference_point_m")


@register("filter", "eskf15")
@dataclass(frozen=True)
class Eskf15:
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

    Scale factors and misalignments are 18 more states, for an IMU that has them: a sensor shows (I + M) y + b, so
    column j of dM is a bias db times y_j in the equations above. They are no noise: half a circle with a gyro that is
    1 mrad out of line leaves 3 mrad of tilt, and the next half circle, to the other side, takes them away.

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
    coning and sculling within a sample, the latency of a receiver. The error k of a wheel's scale is zero, or with
    ``wheel_scale`` one more state, constant. Good where the vehicle turns and accelerates, which makes yaw and biases
    observable, and in outages of up to a minute; it needs an IMU whose data sheet is known.

    Rows that an adaptation sees are those of position and velocity (in the velocity's own frame); headings and
    constraints are not adapted, and not among the recorded updates. It takes every adaptation that changes R alone.

    The engine `filterpy` runs all of this in NumPy, a step at a time: the definition of right. The engine `compiled`
    runs the same by the blocks of Phi that are not zero, compiled, and agrees to 1e-9 m, and to 1e-12 of
    sqrt(P_ii P_jj) or what the run itself makes of changes in the last bits of its input.

    Source: P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed.,
    chapters 5 and 14, reduced to a tangent plane.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: white noise of the accelerometer [m/s/sqrt(h)].
        gyro_instability_deg_per_h: sigma of the wandering part of the gyro's bias; 0: it is constant [deg/h].
        gyro_correlation_s: tau of it [s].
        accel_instability_mg: sigma of the wandering part of the accelerometer's bias; 0: it is constant [mg].
        accel_correlation_s: tau of it [s].
        gyro_turn_on_deg_per_h: one sigma of the gyro's bias at the start [deg/h].
        accel_turn_on_mg: one sigma of the accelerometer's bias at the start [mg].
        gyro_scale_ppm: one sigma of each scale factor of the gyro; 0, and so the next two: no such states [1e-6].
        accel_scale_ppm: one sigma of each scale factor of the accelerometer [1e-6].
        misalignment_mrad: one sigma of the tilt of each axis towards each other, in both sensors [mrad].
        gyro_bias_from_rest: whether the gyro's mean over the rest at the start is its first bias.
        yaw_source: first yaw, attitude (of the attitude filter) or track (of the fixes, whatever else there is).
        initial_yaw_sigma_rad: one sigma of the first yaw, where its source is no less sure itself [rad].
        track_least_m: how far apart two fixes have to be to show a course of the track [m].
        position_sigma_m: one sigma of each axis of a fix, in place of the reported covariance; null: as reported [m].
        antenna_m: lever arm from the IMU to the antenna, body: forward, left, up [m].
        use_velocity: whether the velocity is used.
        use_heading: whether a measured heading is used; one that is a course is taken for the body's.
        wheel_scale: whether the error of a wheel's scale is estimated; needs a velocity in the frame "speed".
        wheel_scale_sigma: one sigma of it at the start.
        zero_velocity: whether the vehicle is held when it stands still.
        zero_velocity_sigma_mps: one sigma of each axis then, and of the velocity at a start at rest [m/s].
        still_window_s: how long the IMU has to be still [s].
        still_accel_mps2: standard deviation of the accelerometer below which it is, three axes together [m/s2].
        still_gyro_radps: standard deviation of the gyro below which it is, three axes together [rad/s].
        still_below_mps: estimated speed below which it may be [m/s].
        nonholonomic: whether the vehicle does not move sideways and upwards.
        nonholonomic_sigma_mps: one sigma of each of the two [m/s].
        nonholonomic_point_m: where that holds, and where a wheel measures (rear axle), from the IMU, body [m].
        constraint_interval_s: time between two zero-velocity or non-holonomic updates [s].
        reference_point_m: the point whose position and velocity are given out, from the IMU, body [m].
        earth_rotation: whether the Earth's rotation is taken into account; needs the recording's origin, and a gyro
            from which the mean at rest was not taken.
        earth_curvature: whether gravity turns with the position.
    """

    title: ClassVar[str] = "eskf15"
    invariant: ClassVar[bool] = False

    angle_random_walk_deg_per_sqrt_h: Annotated[
        float,
        Range(0.01, 60.0, log=True, source=GRADES),
        Origin("data sheet: the simulated field's IMU, 0.0017 rad/s and 0.02 m/s2 a sample at 100 Hz"),
    ] = 0.6
    velocity_random_walk_mps_per_sqrt_h: Annotated[
        float,
        Range(0.005, 20.0, log=True, source=GRADES),
        Origin("data sheet: the simulated field's IMU, 0.0017 rad/s and 0.02 m/s2 a sample at 100 Hz"),
    ] = 0.12
    gyro_instability_deg_per_h: Annotated[
        float, Range(0.1, 500.0, log=True, source=GRADES), Origin("ours, of the order of an industrial MEMS module")
    ] = 5.0
    gyro_correlation_s: Annotated[float, Origin("ours: long against an outage")] = 1000.0
    accel_instability_mg: Annotated[
        float, Range(0.005, 10.0, log=True, source=GRADES), Origin("ours, of the order of an industrial MEMS module")
    ] = 0.1
    accel_correlation_s: Annotated[float, Origin("ours: long against an outage")] = 1000.0
    gyro_turn_on_deg_per_h: Annotated[float, Origin("ours, of the order of an industrial MEMS module")] = 500.0
    accel_turn_on_mg: Annotated[float, Origin("ours, of the order of an industrial MEMS module")] = 10.0
    gyro_scale_ppm: Annotated[float, Origin("off: 18 states fewer")] = 0.0
    accel_scale_ppm: Annotated[float, Origin("off")] = 0.0
    misalignment_mrad: Annotated[float, Origin("off")] = 0.0
    gyro_bias_from_rest: bool = True
    yaw_source: str = "attitude"
    initial_yaw_sigma_rad: Annotated[float, Origin("ours: 3 degrees")] = 0.05
    track_least_m: float = 1.0
    position_sigma_m: float | None = None
    antenna_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    use_velocity: bool = True
    use_heading: bool = True
    wheel_scale: bool = False
    wheel_scale_sigma: Annotated[float, Origin("ours: 2 %, tyres")] = 0.02
    zero_velocity: bool = False
    zero_velocity_sigma_mps: Annotated[float, Origin("ours")] = 0.02
    still_window_s: float = 1.0
    still_accel_mps2: float = 0.1
    still_gyro_radps: float = 0.01
    still_below_mps: float = 0.3
    nonholonomic: bool = False
    nonholonomic_sigma_mps: Annotated[
        float, Range(0.02, 2.0, log=True, source="ours: from a car on rails to a tractor on a slope"), Origin("ours")
    ] = 0.2
    nonholonomic_point_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    constraint_interval_s: float = 0.1
    reference_point_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    earth_rotation: bool = False
    earth_curvature: bool = False

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.yaw_source not in YAW_SOURCES:
            raise PluginError(unknown(f"yaw_source of filter {self.title}", self.yaw_source, YAW_SOURCES))
        given = ("position_sigma_m",) if self.position_sigma_m is not None else ()
        for name in (*POSITIVE, *given):
            if not getattr(self, name) > 0:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; it must be positive.")
        for name in (*INSTABILITIES, *DEFORMATION):
            if not getattr(self, name) >= 0:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; it must be 0 (constant) or more.")
        require_not_negative(f"filter {self.title}", self, (*SIGMAS, *DEFORMATION, *given))
        if len({getattr(self, name) > 0 for name in DEFORMATION}) == 2:
            raise PluginError(f"{self.title}: {', '.join(DEFORMATION)} belong together; give all three, or 0 for all.")
        for name in ARMS:
            if len(getattr(self, name)) != 3:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; give three: forward, left, up.")

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
            self._aided(load())

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        return self.solve(recording, attitude, adaptation).estimate

    def solve(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> InertialSolution:
        """Return the navigation solution with the state and the whole covariance at the end."""
        journey = self.journey(recording, attitude)
        run = InertialRun(journey.imu, journey.timeline, journey.headings, journey.start, adaptation, journey.settings)
        return run.over(journey.events)

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same as `estimate`; None where numba cannot compile the adaptation."""
        from jerkbench.inertial.compiled.solution import solve_compiled

        solution = solve_compiled(_prepared(self, recording, attitude, wants_truth(adaptation)), adaptation)
        return None if solution is None else solution.estimate

    def run_many(
        self, runs: Sequence[RecordedRun], adaptation: Adaptation, *, updates: bool, attitude: bool, threads: int
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, as in `jerkbench.contracts.Batched`."""
        settings = [self] * len(runs), [adaptation] * len(runs)
        return self.run_settings(runs, *settings, updates=updates, attitude=attitude, threads=threads)

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
        """Return the same, each run with its own of ``estimators`` and ``adaptations``.

        Runs whose measurements are states of the filter go eight side by side, the others one at a time.
        """
        from jerkbench.inertial.streamed_runs import stream_all

        def prepared(k: int) -> "Prepared":
            """Return run ``k``."""
            return _prepared(estimators[k], runs[k].recording, runs[k].attitude, wants_truth(adaptations[k]))

        scorings = [run.scoring for run in runs]
        return stream_all(prepared, scorings, adaptations, updates=updates, attitude=attitude, threads=threads)

    def journey(self, recording: Recording, attitude: Attitude) -> Journey:
        """Return everything that a run needs besides its adaptation."""
        recording = self._aided(recording)
        timeline = _timeline(recording, attitude)
        headings = recording.heading if self.use_heading else None
        events = merge_events(timeline, recording.inertial, headings, self.constraint_interval_s)
        start = self._start(recording, attitude, timeline)
        return Journey(recording.inertial, timeline, headings, events, start, self._settings(recording))

    def sensor_noise(self) -> SensorNoise:
        """Return the process noise in SI units."""
        gyro, accel = self.gyro_instability_deg_per_h * DEG_PER_H, self.accel_instability_mg * MG
        return SensorNoise(
            angle=float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) * PER_SQRT_H) ** 2,
            velocity=(self.velocity_random_walk_mps_per_sqrt_h * PER_SQRT_H) ** 2,
            gyro_bias=float(2.0 * gyro**2 / self.gyro_correlation_s),
            accel_bias=float(2.0 * accel**2 / self.accel_correlation_s),
        )

    def _aided(self, recording: Recording) -> Recording:
        """The recording with the measurements, and the fixes' covariance, that are asked for.

        Raises:
            RecordingError: the wheel's scale is asked for, and there is no wheel's speed.
        """
        if not self.use_velocity:
            recording = replace(recording, velocity=None)
        if self.wheel_scale and _velocity_frame(recording) != "speed":
            raise RecordingError(
                f"{recording.name}: {self.title}.wheel_scale needs a wheel's speed, and the velocity that is used is"
                f" {'none' if recording.velocity is None else recording.velocity.frame}; switch wheel_scale off."
            )
        if self.position_sigma_m is not None and recording.position is not None:
            covariance = np.broadcast_to(self.position_sigma_m**2 * np.eye(3), recording.position.covariance_m2.shape)
            recording = replace(recording, position=replace(recording.position, covariance_m2=covariance))
        return recording

    def _start(
        self, recording: Recording, attitude: Attitude, timeline: Timeline
    ) -> tuple[NavigationState, FloatArray]:
        yaw_rad, yaw_sigma_rad = self._yaw(recording, attitude, int(timeline.sample[0]))
        sigmas = StartSigmas(
            gyro_bias_radps=float(self.gyro_turn_on_deg_per_h * DEG_PER_H),
            accel_bias_mps2=self.accel_turn_on_mg * MG,
            yaw_rad=max(self.initial_yaw_sigma_rad, yaw_sigma_rad),
            still_mps=self.zero_velocity_sigma_mps,
            gyro_scale=self.gyro_scale_ppm * 1e-6,
            accel_scale=self.accel_scale_ppm * 1e-6,
            misalignment_rad=self.misalignment_mrad * 1e-3,
            wheel_scale=self.wheel_scale_sigma if self.wheel_scale else 0.0,
        )
        noise, from_rest = self.sensor_noise(), self.gyro_bias_from_rest
        state, P = align(recording, attitude, timeline, yaw_rad, sigmas, noise, gyro_bias_from_rest=from_rest)
        if _velocity_frame(recording) != "enu":
            state, P = with_body_velocity(state, P, attitude.dcm[timeline.sample[0]])
        return state._replace(position_m=state.position_m - state.dcm @ np.array(self.antenna_m)), P

    def _yaw(self, recording: Recording, attitude: Attitude, sample: int) -> tuple[float, float]:
        """First yaw and its sigma, as its source sees it; an attitude that says none is taken to be sure."""
        if self.yaw_source == "track":
            track, (roll, pitch, _) = required_track(recording, self.track_least_m), attitude.euler_rad.T
            yaw = filtered_yaw(recording.inertial, roll, pitch, track, YAW_WALK, COURSE_SIGMA_RAD)
            return float(yaw.rad[sample]), float(yaw.sigma_rad[sample])
        known = attitude.yaw_sigma_rad
        return float(attitude.euler_rad[sample, 2]), 0.0 if known is None else float(known[sample])

    def _settings(self, recording: Recording) -> Settings:
        imu = recording.inertial
        still = np.zeros(len(imu.t_s), dtype=np.bool_)
        if self.zero_velocity:
            still = still_samples(imu, self.still_window_s, self.still_accel_mps2, self.still_gyro_radps)
        constraints = Constraints(
            still=still,
            still_below_mps=self.still_below_mps,
            still_sigma_mps=self.zero_velocity_sigma_mps,
            sideways_sigma_mps=self.nonholonomic_sigma_mps if self.nonholonomic else 0.0,
            sideways_point_m=np.array(self.nonholonomic_point_m),
        )
        return Settings(
            noise=self.sensor_noise(),
            earth=earth_at(recording.origin, rotates=self.earth_rotation, curved=self.earth_curvature),
            antenna_m=np.array(self.antenna_m),
            reference_point_m=np.array(self.reference_point_m),
            velocity_frame=_velocity_frame(recording),
            wheel_m=np.array(self.nonholonomic_point_m),
            constraints=constraints,
            invariant=self.invariant,
        )


def _timeline(recording: Recording, attitude: Attitude) -> Timeline:
    """The events with the velocity as it is measured, and the start with the velocity in ENU."""
    timeline = build_timeline(_as_measured(recording), attitude)
    if _velocity_frame(recording) == "enu":
        return timeline
    turned = build_timeline(recording, attitude)
    return replace(timeline, x0=turned.x0, P0=turned.P0)


def _velocity_frame(recording: Recording) -> str:
    return "enu" if recording.velocity is None else recording.velocity.frame


def _as_measured(recording: Recording) -> Recording:
    """The recording with its velocity taken as it is: this filter turns one of the body with its own attitude."""
    if recording.velocity is None:
        return recording
    return replace(recording, velocity=replace(recording.velocity, frame="enu"))


@lru_cache(maxsize=32)  # as many as a process keeps recordings; for the next adaptation
def _prepared(model: Eskf15, recording: Recording, attitude: Attitude, wants_truth: bool) -> "Prepared":
    """Everything that a compiled run needs besides its adaptation."""
    from jerkbench.inertial.compiled.solution import prepare

    return prepare(model.journey(recording, attitude), wants_truth=wants_truth)
