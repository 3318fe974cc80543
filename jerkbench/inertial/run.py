"""One run of the error-state inertial navigation over the events of a recording."""

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Estimate
from jerkbench.geometry import euler_from_dcm
from jerkbench.inertial.earth import Earth
from jerkbench.inertial.error_model import SensorNoise, StepModel, propagated, step_model, transition
from jerkbench.inertial.events import Events
from jerkbench.inertial.measurement_models import heading, point_in_enu, velocity_in_body, wheel_speed, widened
from jerkbench.inertial.mechanisation import advance, calibrated
from jerkbench.inertial.state import PHI, NavigationState, corrected, is_finite
from jerkbench.inertial.update import carried_over, correction
from jerkbench.recording import Heading, Imu
from jerkbench.timeline.recorder import Recorder
from jerkbench.timeline.timeline import Timeline


class Adapts(Protocol):
    """What a run needs of an adaptation; `jerkbench.contracts.Adaptation` has it."""

    def memory_size(self) -> int:
        """Return the length of the memory."""
        ...

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the R to use."""
        ...


class Constraints(NamedTuple):
    """What the vehicle cannot do.

    Attributes:
        still: (n,) whether it stands still at each IMU sample; all False: no zero-velocity update.
        still_below_mps: only when the estimated speed is below.
        still_sigma_mps: one sigma of each axis of the velocity when it stands.
        sideways_sigma_mps: one sigma of the velocity sideways and upwards in the body; 0: no such constraint.
        sideways_point_m: (3,) where that holds, from the IMU, in the body.
    """

    still: BoolArray
    still_below_mps: float
    still_sigma_mps: float
    sideways_sigma_mps: float
    sideways_point_m: FloatArray


class Settings(NamedTuple):
    """Everything about a run that is not measured.

    Attributes:
        noise: of the sensors.
        earth: gravity and rotation.
        antenna_m: (3,) from the IMU, in the body.
        reference_point_m: (3,) the point whose position is given out, from the IMU, in the body.
        velocity_frame: of rows 3 to 5 of z: "enu" (of the antenna), "body" (of the IMU), or "speed" (body, of the
            wheel).
        wheel_m: (3,) where the wheel measures, from the IMU, in the body.
        constraints: what the vehicle cannot do.
    """

    noise: SensorNoise
    earth: Earth
    antenna_m: FloatArray
    reference_point_m: FloatArray
    velocity_frame: str
    wheel_m: FloatArray
    constraints: Constraints


class InertialSolution(NamedTuple):
    """What a run gives.

    Attributes:
        estimate: at the reference's stamps.
        state: nominal state at the end.
        covariance: (n, n) of its error, n as in `jerkbench.inertial.state.error_states`.
    """

    estimate: Estimate
    state: NavigationState
    covariance: FloatArray


class InertialRun:
    """The state of one run, and its steps."""

    def __init__(
        self,
        imu: Imu,
        timeline: Timeline,
        headings: Heading | None,
        start: tuple[NavigationState, FloatArray],
        adaptation: Adapts,
        settings: Settings,
    ) -> None:
        """Put a run together; it starts from the state and covariance of ``start``."""
        self.imu, self.timeline, self.headings, self.settings = imu, timeline, headings, settings
        self.state, self.P = start
        self.adaptation, self.memory = adaptation, np.zeros(adaptation.memory_size())
        measured = timeline.measurements
        self.R = measured.R_true if getattr(adaptation, "wants_true_covariance", False) else measured.R
        self.step_models: dict[int, StepModel] = {}
        self.rate = np.zeros(3)
        self.reference_is_imu = not settings.reference_point_m.any()
        self.recorder = Recorder(timeline)
        self.dcms: list[FloatArray] = []

    def over(self, events: Events) -> InertialSolution:
        """Go through ``events``; stops at the first sign of divergence."""
        columns = (events.t_s, events.dt_s, *events[2:])
        for t, dt, sample, update, row, constrained, reference in zip(*(c.tolist() for c in columns), strict=True):
            if dt > 0:
                self._predict(dt, sample)
            if update >= 0:
                self._update(update)
            if row >= 0 and self.headings is not None:
                self._take_heading(float(self.headings.yaw_rad[row]), float(self.headings.sigma_rad[row]))
            if constrained:
                self._constrain(sample)
            if (update >= 0 or row >= 0 or constrained) and not self._is_healthy():
                return self._solution(f"the covariance is no longer positive definite at {t:.2f} s")
            if reference >= 0:
                self._keep(reference)
        return self._solution()

    def _predict(self, dt: float, sample: int) -> None:
        accel, gyro = self.imu.accel_mps2[sample], self.imu.gyro_radps[sample]
        sensed = calibrated(self.state, accel, gyro)
        self.state, dcm, force = advance(self.state, *sensed, dt, self.settings.earth)
        self.rate = sensed[1]
        step = self._step_model(dt)
        self.P = propagated(self.P, transition(step, dcm, force, sensed), step.Q)

    def _step_model(self, dt: float) -> StepModel:
        """The model of a step of dt, made once for each whole nanosecond."""
        key = round(dt * 1e9)
        if key not in self.step_models:
            self.step_models[key] = step_model(self.settings.noise, dt, len(self.P))
        return self.step_models[key]

    def _update(self, update: int) -> None:
        """Adapt R and take position and velocity."""
        measured = self.timeline.measurements
        rows = np.flatnonzero(np.isfinite(measured.z[update]))
        block = np.ix_(rows, rows)
        h, H = self._expected()
        innovation, H = measured.z[update, rows] - h[rows], H[rows]
        HPHt = H @ self.P @ H.T
        nis = float(innovation @ np.linalg.solve(HPHt + measured.R[update][block], innovation))
        R = self.adaptation.adapt(innovation, HPHt, self.R[update][block], rows, self.memory)
        kept, used = np.isfinite(np.diag(R)), float("nan")
        if kept.any():
            used = self._correct(innovation[kept], H[kept], R[np.ix_(kept, kept)])
        self.recorder.update(update, rows, innovation, np.diag(R), nis, used)

    def _expected(self) -> tuple[FloatArray, FloatArray]:
        """The six rows of position and velocity that the state expects, and their H."""
        h, H = point_in_enu(self.state, self.rate, self.settings.antenna_m)
        if self.settings.velocity_frame == "body":
            h[3:], H[3:] = velocity_in_body(self.state, self.rate, np.zeros(3))
        elif self.settings.velocity_frame == "speed":
            H = np.pad(H, ((0, 0), (0, 1)))
            h[3:], H[3:] = wheel_speed(self.state, self.rate, self.settings.wheel_m)
        return h, widened(H, len(self.P), self.rate)

    def _take_heading(self, yaw_rad: float, sigma_rad: float) -> None:
        expected, H = heading(self.state)
        innovation = np.remainder(yaw_rad - expected + np.pi, 2.0 * np.pi) - np.pi
        self._correct(np.array([innovation]), H, np.array([[sigma_rad**2]]))

    def _constrain(self, sample: int) -> None:
        """Zero velocity when it stands still, else none sideways and upwards."""
        limits = self.settings.constraints
        slow = np.linalg.norm(self.state.velocity_mps) < limits.still_below_mps
        if limits.still[sample] and slow:
            h, H = point_in_enu(self.state, self.rate, np.zeros(3))
            self._correct(-h[3:], H[3:], limits.still_sigma_mps**2 * np.eye(3))
        elif limits.sideways_sigma_mps > 0:
            h, H = velocity_in_body(self.state, self.rate, limits.sideways_point_m)
            self._correct(-h[1:], H[1:], limits.sideways_sigma_mps**2 * np.eye(2))

    def _correct(self, innovation: FloatArray, H: FloatArray, R: FloatArray) -> float:
        """Update with rows that are there; return their NIS."""
        dx, self.P, nis = correction(self.P, innovation, widened(H, len(self.P), self.rate), R)
        before = self.state
        self.state = corrected(before, dx)
        self.P = carried_over(self.P, before, self.state, dx[PHI])
        return nis

    def _keep(self, reference: int) -> None:
        """Keep position and velocity of the reference point, and the attitude."""
        if self.reference_is_imu:  # nearly always, and at every step where the reference is that dense
            x, P = np.concatenate([self.state.position_m, self.state.velocity_mps]), self.P[:6, :6]
        else:
            x, H = point_in_enu(self.state, self.rate, self.settings.reference_point_m)
            H = widened(H, len(self.P), self.rate)
            P = H @ self.P @ H.T
        self.recorder.state(reference, x, P)
        self.dcms.append(self.state.dcm)

    def _is_healthy(self) -> bool:
        if not (is_finite(self.state) and np.isfinite(self.P).all()):
            return False
        try:
            np.linalg.cholesky(self.P)
        except np.linalg.LinAlgError:
            return False
        return True

    def _solution(self, failure: str = "") -> InertialSolution:
        estimate = self.recorder.estimate(failure)
        euler_rad = euler_from_dcm(np.array(self.dcms)) if self.dcms else np.empty((0, 3))
        return InertialSolution(replace(estimate, euler_rad=euler_rad), self.state, self.P)
