"""Compiled runs of the navigation from Python: an estimate with its trajectory, or the sums of many runs."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.views import Lanes
from jerkbench.contracts import Adaptation, clocked
from jerkbench.estimate import ErrorWeights, Streamed
from jerkbench.geometry import euler_from_rotations
from jerkbench.inertial.kernel import Inertial, inertial_type, run_navigation
from jerkbench.inertial.run import InertialSolution
from jerkbench.inertial.run_inputs import InertialSettings, Journey
from jerkbench.inertial.state import ErrorLayout, NavigationState, nominal_numbers
from jerkbench.kinematic.loop import APART, runs_of
from jerkbench.kinematic.packs import Pack
from jerkbench.kinematic.plugin_call import compiled_rule
from jerkbench.kinematic.runs import run_alone, run_packs
from jerkbench.recording import Imu
from jerkbench.timeline import Run, Timeline, step_lengths

_OWN = (
    *("run_navigation", "begin", "mechanise", "propagate", "transform_covariance", "take_update", "feed_back"),
    *("fill_turn", "_fill_large", "observe", "conclude", "constrain", "take_heading", "keep_point"),
)
"""Kernels that stand alone: one body of all of them takes long to compile."""

NO_INPUT = np.empty((0, 3))
"""The acceleration that kinematic filters are driven by."""


def solve_compiled(journey: Journey, adaptation: Adaptation) -> InertialSolution | None:
    """Run with a trajectory; None where numba cannot compile the adaptation."""
    rule = compiled_rule(clocked(adaptation, journey.timeline))
    if rule is None:
        return None
    lengths_s, which = step_lengths(journey.events.dt_s)
    visited = int(np.count_nonzero(journey.events.reference >= 0))
    own, of = inertial_of([journey], lengths_s, visited), _type_of(journey, 1)
    estimate, w = run_alone(_split(journey), which, rule, (_loop_of(journey, 1), of, own))
    euler_rad = euler_from_rotations(own.dcm[: len(estimate.index), :, 0].reshape(-1, 3, 3))
    return InertialSolution(replace(estimate, euler_rad=euler_rad), *_end(w, of, journey.start[0].layout))


def stream_journeys(
    journeys: Sequence[Journey | None],
    scorings: Sequence[ErrorWeights],
    adaptations: Sequence[Adaptation],
    *,
    updates: bool,
    attitude: bool,
    threads: int,
) -> list[Streamed | None]:
    """Run ``journeys`` without trajectories, those of like steps side by side.

    Args:
        journeys: the runs; None where one is not to be run.
        scorings: what the errors of each count for.
        adaptations: their adaptations.
        updates: whether to keep what the updates saw.
        attitude: whether to keep the attitude.
        threads: how many to use.

    Returns:
        The sums of each run; None where it needs a trajectory: it is lost, does not visit every stamp that counts, or
        numba cannot compile its adaptation.
    """
    chosen = [
        (k, journey, rule)
        for k, journey in enumerate(journeys)
        if journey is not None and np.count_nonzero(journey.events.reference >= 0) == len(scorings[k].truth)
        if (rule := compiled_rule(clocked(adaptations[k], journey.timeline))) is not None
    ]
    attitudes: dict[int, FloatArray] = {}

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...]:
        own = [chosen[k][1] for k in lanes]
        inertial = inertial_of(own, pack.lengths_s, len(pack.scored.truth) if attitude else 0)
        attitudes.update((k, inertial.dcm[:, :, lane]) for lane, k in enumerate(pack.members))
        return _loop_of(own[0], WIDE), _type_of(own[0], WIDE), inertial

    runs = [Run(_split(journey), scorings[k]) for k, journey, _ in chosen]
    kinds = [(journey.start[0].layout, journey.settings.invariant) for _, journey, _ in chosen]
    sums = run_packs(runs, kinds, [rule for *_, rule in chosen], prepare, updates=updates, threads=threads)
    results: list[Streamed | None] = [None] * len(journeys)
    for place, (k, *_) in enumerate(chosen):
        result = sums[place]
        if result is not None and attitude:
            result = result._replace(euler_rad=euler_from_rotations(attitudes[place].reshape(-1, 3, 3)))
        results[k] = result
    return results


def _type_of(journey: Journey, width: int) -> Lanes:
    return inertial_type(journey.start[0].layout, width, invariant=journey.settings.invariant)


def _loop_of(journey: Journey, width: int) -> Any:  # noqa: ANN401 - numba has no types
    return _compiled(journey.start[0].layout, width, invariant=journey.settings.invariant)


@cache
def _compiled(layout: ErrorLayout, width: int, *, invariant: bool) -> Any:  # noqa: ANN401 - numba has no types
    """The loop of ``width`` runs for an error state of that layout, invariant or additive."""
    title = f"the {'invariant ' if invariant else ''}inertial navigation of {runs_of(width)} with {layout.size} states"
    constants = {"RUN": inertial_type(layout, width, invariant=invariant), "DENSE": 0}
    return compiled_loop(run_navigation, title, constants, APART + _OWN)


def _split(journey: Journey) -> Timeline:
    """The timeline of a run with the steps of its events, which headings split further."""
    e = journey.events
    return replace(
        journey.timeline,
        t_s=e.t_s,
        dt_s=e.dt_s,
        sample=e.sample,
        update=e.update,
        reference=e.reference,
        accel_enu_mps2=NO_INPUT,
    )


# The arguments of the loop.


def inertial_of(journeys: Sequence[Journey], lengths_s: FloatArray, visited: int) -> Inertial:
    """Return what ``journeys`` sense, their settings and their begin; room for the attitude at ``visited`` stamps."""
    settings = [journey.settings for journey in journeys]
    accel_mps2, gyro_radps = _sensed(tuple(journey.imu for journey in journeys))
    body = [float(s.velocity_frame != "enu") for s in settings]
    wheel = [float(s.velocity_frame == "speed") for s in settings]
    limits = [s.constraints for s in settings]
    return Inertial(
        np.array(lengths_s),
        accel_mps2,
        gyro_radps,
        _lanes([np.array(s.noise) for s in settings]),
        _lanes([np.append(s.earth.rate_radps * s.earth.rotates, s.earth.per_radius) for s in settings]),
        any(s.earth.rotates for s in settings),
        _lanes([_arms(s) for s in settings]),
        np.array([body, wheel]),
        _lanes([np.array([c.still_below_mps, c.still_sigma_mps, c.sideways_sigma_mps]) for c in limits]),
        not any(body) and not any(s.antenna_m.any() for s in settings),
        not any(s.reference_point_m.any() for s in settings),
        _lanes([nominal_numbers(journey.start[0]) for journey in journeys]),
        _lanes([journey.start[1].ravel() for journey in journeys]),
        len(journeys[0].start[1]),
        *_headings(journeys),
        *_constraints(journeys),
        np.empty((visited, 9, len(journeys))),
    )


def _arms(s: InertialSettings) -> FloatArray:
    """Lever arms (4, 3), as `Inertial` has them; a velocity along the body is that of the IMU."""
    velocity_m = {"enu": s.antenna_m, "body": np.zeros(3), "speed": s.wheel_m}[s.velocity_frame]
    return np.array([s.antenna_m, velocity_m, s.constraints.sideways_point_m, s.reference_point_m])


def _lanes(parts: Sequence[FloatArray]) -> FloatArray:
    return np.ascontiguousarray(np.stack(parts, axis=-1), np.float64)


@lru_cache(maxsize=8)  # for the next adaptation; some 6 MB each
def _sensed(imus: tuple[Imu, ...]) -> tuple[FloatArray, FloatArray]:
    """Specific force and rate in vectors."""
    return _lanes([imu.accel_mps2 for imu in imus]), _lanes([imu.gyro_radps for imu in imus])


def _headings(journeys: Sequence[Journey]) -> tuple[IntArray, FloatArray]:
    """The row of each step, and the rows of all journeys: NaN where one has none, with a sigma of one."""
    events = np.array([journey.events.heading for journey in journeys])
    headed, rows = _rows_where((events >= 0).any(axis=0))
    yaw = np.ones((len(headed), 2, len(journeys)))
    yaw[:, 0] = np.nan
    for lane, journey in enumerate(journeys):
        which = events[lane, headed]
        if journey.headings is not None:
            yaw[which >= 0, 0, lane] = journey.headings.yaw_rad[which[which >= 0]]
            yaw[which >= 0, 1, lane] = journey.headings.sigma_rad[which[which >= 0]]
    return rows, yaw


def _constraints(journeys: Sequence[Journey]) -> tuple[IntArray, FloatArray]:
    """The row of each step, and the rows of all journeys: 2 still, 1 not, 0 nothing is due."""
    held = np.array([_held(journey) for journey in journeys])
    due, rows = _rows_where(held.any(axis=0))
    return rows, np.ascontiguousarray(held[:, due].T)


def _held(journey: Journey) -> FloatArray:
    events, limits = journey.events, journey.settings.constraints
    still = limits.still[events.sample]
    due = events.constrained & (still | (limits.sideways_sigma_mps > 0))
    return np.asarray(due * (1.0 + still))


def _rows_where(due: Any) -> tuple[IntArray, IntArray]:  # noqa: ANN401 - of booleans
    """Which steps are due, and the number of each of them; -1 elsewhere."""
    places = np.flatnonzero(due)
    rows = np.full(len(due), -1, dtype=np.int64)
    rows[places] = np.arange(len(places))
    return places, rows


def _end(w: FloatArray, of: Lanes, layout: ErrorLayout) -> tuple[NavigationState, FloatArray]:
    """State and covariance where a run has ended."""

    def part(name: str) -> Any:  # noqa: ANN401 - an array, or a number
        view = of.fields[name]
        return w[list(view.places)].reshape(view.shape)[()]

    x, extra = part("x"), {name: part(name) for name in layout.extra}
    return NavigationState(x[:3], x[3:6], part("C"), part("gyro_bias"), part("accel_bias"), **extra), part("P")
