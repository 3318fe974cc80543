"""Runs from Python: prepared events in, an estimate or sums out."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.estimate import Estimate, Updates
from jerkbench.estimation.adaptation_call import rule_of
from jerkbench.estimation.sums import SEEN, score_of, streamed_from
from jerkbench.geometry import euler_from_rotations
from jerkbench.inertial.compiled.arguments import Flow, Given, Kept
from jerkbench.inertial.compiled.layout import column, places
from jerkbench.inertial.compiled.loop import run_events
from jerkbench.inertial.run import InertialSolution
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.state import Deformation, NavigationState
from jerkbench.optional import clocked
from jerkbench.sums import Scoring, Streamed
from jerkbench.timeline import Timeline

FRAMES = ("enu", "body", "speed")

APART = (
    *("run_events", "mechanise", "propagate", "move_column", "_fill_noise", "update", "take_heading", "constrain"),
    *("keep_state", "add_state", "_add_nees", "project", "pick", "distance", "correct", "feed_back", "_carry"),
    *("exchange", "symmetrise", "is_healthy", "clear", "expect_point", "expect_body_velocity", "fill_rotation"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""


class Prepared(NamedTuple):
    """A run, ready for any adaptation that asks for the same covariance."""

    journey: Journey
    flow: Flow
    given: Given


def prepare(journey: Journey, *, wants_truth: bool) -> Prepared:
    """Bring a run into the layout of the compiled loop; it gets the true or the reported covariance as R."""
    return Prepared(journey, flow_of(journey, wants_truth=wants_truth), given_of(journey))


def solve_compiled(prepared: Prepared, adaptation: object) -> InertialSolution | None:
    """Run with a trajectory; None where numba cannot compile the adaptation."""
    rule = rule_of(clocked(adaptation, prepared.journey.timeline))
    if rule is None:
        return None
    journey, flow, given = prepared
    states, m, timeline = len(journey.start[1]), start_of(journey), journey.timeline
    k, u = int(np.count_nonzero(flow.reference >= 0)), int(np.count_nonzero(flow.update >= 0))
    kept = _make_kept(k, u, k)
    reached, taken, failed = _loop_of(journey)(flow, given, rule, kept, score_of(None, np.empty(0)), m)
    failure = ""
    if failed >= 0:
        failure = f"the covariance is no longer positive definite at {journey.events.t_s[failed]:.2f} s"
    x = kept.x[:reached]
    estimate = Estimate(
        kept.reference[:reached],
        x[:, :3],
        x[:, 3:],
        kept.P[:reached].reshape(-1, 6, 6),
        euler_from_rotations(kept.dcm[:reached].reshape(-1, 3, 3)),
        _updates(timeline, kept, taken),
        failure,
    )
    return InertialSolution(estimate, *_end(m, states))


def stream_compiled(
    prepared: Prepared, scoring: Scoring, adaptation: object, *, updates: bool, attitude: bool
) -> Streamed | None:
    """Run without a trajectory; None where that needs one: numba cannot compile the adaptation, or the run is lost.

    Args:
        prepared: the run.
        scoring: what its errors count for.
        adaptation: the adaptation.
        updates: whether to keep what the updates saw.
        attitude: whether to keep the attitude.
    """
    rule = rule_of(clocked(adaptation, prepared.journey.timeline))
    if rule is None:
        return None
    journey, flow, given = prepared
    update_s = np.asarray(journey.timeline.measurements.t_ns * 1e-9, dtype=np.float64)
    score, visited = score_of(scoring, update_s), len(scoring.truth)
    u = int(np.count_nonzero(flow.update >= 0)) if updates else 0
    kept = _make_kept(0, u, visited if attitude else 0)
    reached, taken, failed = _loop_of(journey)(flow, given, rule, kept, score, start_of(journey))
    if failed >= 0 or reached != visited:
        return None
    seen = _updates(journey.timeline, kept, taken) if updates else Updates.empty()
    euler_rad = euler_from_rotations(kept.dcm.reshape(-1, 3, 3)) if attitude else None
    return streamed_from(score, scoring, seen, euler_rad)


def _loop_of(journey: Journey) -> Any:  # noqa: ANN401 - numba has no types
    return _compiled(len(journey.start[1]), invariant=journey.settings.invariant)


@cache
def _compiled(states: int, *, invariant: bool) -> Any:  # noqa: ANN401 - numba has no types
    """The loop for an error state of that size, invariant or additive."""
    title = f"the {'invariant ' if invariant else ''}inertial navigation with {states} states"
    return compiled_loop(run_events, title, places(states, invariant=invariant), APART)


def flow_of(journey: Journey, *, wants_truth: bool) -> Flow:
    """Return the events, and what they point to, as arrays of the layout that the compiled loop takes."""
    events, imu, measured = journey.events, journey.imu, journey.timeline.measurements
    limits, headings = journey.settings.constraints, journey.headings
    due = events.constrained & (limits.still[events.sample] | (limits.sideways_sigma_mps > 0))
    yaw = np.empty((0, 2)) if headings is None else np.column_stack([headings.yaw_rad, headings.sigma_rad])
    return Flow(
        plain(events.dt_s, np.float64),
        plain(events.sample, np.int64),
        plain(events.update, np.int64),
        plain(events.heading, np.int64),
        plain(due, np.int64),
        plain(events.reference, np.int64),
        plain(imu.accel_mps2, np.float64),
        plain(imu.gyro_radps, np.float64),
        plain(limits.still, np.int64),
        plain(measured.z, np.float64),
        plain(measured.R_true if wants_truth else measured.R, np.float64),
        plain(measured.R, np.float64),
        plain(yaw, np.float64),
    )


def plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    """Return ``array`` contiguous and writeable, copied only if it is not: a compiled signature is exact."""
    return np.require(array, dtype, ["C", "W", "A"])


def given_of(journey: Journey) -> Given:
    """Return what is not measured."""
    s, limits = journey.settings, journey.settings.constraints
    return Given(
        np.array(s.noise, dtype=np.float64),
        bool(s.earth.rotates),
        plain(s.earth.rate_radps, np.float64),
        float(s.earth.per_radius),
        plain(s.antenna_m, np.float64),
        plain(s.reference_point_m, np.float64),
        FRAMES.index(s.velocity_frame),
        plain(s.wheel_m, np.float64),
        float(limits.still_below_mps),
        float(limits.still_sigma_mps),
        float(limits.sideways_sigma_mps),
        plain(limits.sideways_point_m, np.float64),
        np.zeros(3),
    )


def start_of(journey: Journey) -> FloatArray:
    """Return the array in which the run lives, with its begin."""
    state, covariance = journey.start
    n = len(covariance)
    at = places(n)
    m = aligned_zeros(at["LENGTH"])
    none = np.zeros((3, 3))
    deformation = state.deformation or Deformation(none, none)
    parts = {
        "POSITION": state.position_m,
        "VELOCITY": state.velocity_mps,
        "ATTITUDE": state.dcm.ravel(),
        "GYRO_BIAS": state.gyro_bias_radps,
        "ACCEL_BIAS": state.accel_bias_mps2,
        "GYRO_MATRIX": deformation.gyro.T.ravel(),
        "ACCEL_MATRIX": deformation.accel.T.ravel(),
        "WHEEL": np.array([state.wheel_scale]),
    }
    for name, part in parts.items():
        m[at[name] : at[name] + len(part)] = part
    _square(m, n)[:, _columns(n)] = covariance
    return m


def _square(m: FloatArray, states: int) -> FloatArray:
    """The rows of the covariance in the array of a run."""
    at = places(states)
    begin = WIDE * at["P"]
    return m[begin : begin + states * at["STRIDE"]].reshape(states, -1)


def _columns(states: int) -> IntArray:
    return np.array([column(state) for state in range(states)])


def _end(m: FloatArray, states: int) -> tuple[NavigationState, FloatArray]:
    """State and covariance where the run has ended."""
    at = places(states)

    def part(name: str, length: int) -> FloatArray:
        return m[at[name] : at[name] + length].copy()

    matrices = (part(name, 9).reshape(3, 3).T for name in ("GYRO_MATRIX", "ACCEL_MATRIX"))
    state = NavigationState(
        part("POSITION", 3),
        part("VELOCITY", 3),
        part("ATTITUDE", 9).reshape(3, 3),
        part("GYRO_BIAS", 3),
        part("ACCEL_BIAS", 3),
        Deformation(*matrices) if at["DEFORMED"] else None,
        float(m[at["WHEEL"]]),
    )
    return state, _square(m, states)[:, _columns(states)]


def _make_kept(references: int, updates: int, attitudes: int) -> Kept:
    """Make room; for at least one row of each."""
    k, m = max(references, 1), max(updates, 1)
    return Kept(
        np.empty(k, dtype=np.int64),
        np.empty((k, 6)),
        np.empty((k, 36)),
        np.empty((max(attitudes, 1), 9)),
        np.empty(m, dtype=np.int64),
        np.empty((m, SEEN)),
        np.zeros(6, dtype=np.int64),
    )


def _updates(timeline: Timeline, kept: Kept, taken: int) -> Updates:
    seen, t_s = kept.seen[:taken], np.asarray(timeline.measurements.t_ns[kept.which[:taken]] * 1e-9)
    return Updates(t_s, seen[:, 0], seen[:, 1], seen[:, 3], seen[:, 4:10], seen[:, 10:])
