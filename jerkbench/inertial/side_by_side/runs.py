"""Runs side by side from Python: journeys in, sums out."""

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import WIDE
from jerkbench.geometry import euler_from_rotations
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.side_by_side.arguments import Inertial
from jerkbench.inertial.side_by_side.layout import QUANTITIES, inertial_type
from jerkbench.inertial.side_by_side.loop import run_together
from jerkbench.inertial.state import STATES, NavigationState
from jerkbench.kinematic.arguments import empty_runs
from jerkbench.kinematic.batch import results_of, room_of, run_packs
from jerkbench.kinematic.compiled_loop import APART
from jerkbench.kinematic.packs import Kind, Pack
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.recording import Imu
from jerkbench.streamed_run import Run, Scoring, Streamed

OWN = (
    *("run_together", "begin", "mechanise", "propagate", "feed_back", "_carry", "fill_turn", "_fill_large"),
    "take_heading",
)
"""Kernels that stand alone: one body of all of them takes long to compile."""


@cache
def loop_together() -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of WIDE runs."""
    return compiled_loop(
        run_together, f"the inertial navigation of {WIDE} runs", {"RUN": inertial_type(WIDE), "DENSE": 0}, APART + OWN
    )


def goes_together(journey: Journey, scoring: Scoring) -> bool:
    """Whether a run may go side by side with others: H = [I6 0], 15 additive errors, a plane, no step split."""
    s, limits = journey.settings, journey.settings.constraints
    held = limits.sideways_sigma_mps > 0 or limits.still.any()
    apart = s.antenna_m.any() or s.reference_point_m.any() or s.velocity_frame != "enu"
    earth = s.earth.rotates or s.earth.per_radius != 0.0
    split = len(journey.events.dt_s) != len(journey.timeline.dt_s)
    visited = np.count_nonzero(journey.timeline.reference >= 0) == len(scoring.truth)
    other = s.invariant or len(journey.start[1]) != STATES
    return bool(visited and not (other or held or apart or earth or split))


def run_journeys(
    journeys: Sequence[Journey],
    scorings: Sequence[Scoring],
    rules: Sequence[Rule],
    *,
    updates: bool,
    attitude: bool,
    threads: int,
) -> list[Streamed | None]:
    """Run all ``journeys`` that `goes_together` lets through, each with its own compiled adaptation.

    Args:
        journeys: the runs.
        scorings: what their errors count for.
        rules: their adaptations.
        updates: whether to keep what the updates saw.
        attitude: whether to keep the attitude.
        threads: how many to use.

    Returns:
        The sums of each run; None where it is to be repeated alone, because it is lost.
    """
    runs = [Run(journey.timeline, scoring) for journey, scoring in zip(journeys, scorings, strict=True)]
    kinds = [Kind(QUANTITIES, rule.wants_truth, rule.dense) for rule in rules]

    def run_pack(pack: Pack, lanes: Sequence[int]) -> list[Streamed | None]:
        """Run one."""
        kept = room_of(pack, inertial_type(WIDE), updates=updates)
        visited = len(pack.score.truth) if attitude else 0
        _begin_nominal(kept.w, [journeys[k].start[0] for k in lanes])
        inertial = inertial_of([journeys[k] for k in lanes], pack.lengths_s, visited)
        rule, room = rules_of([rules[k] for k in lanes], STATES), empty_runs(QUANTITIES, WIDE)
        loop_together()(pack.steps, pack.score, inertial, rule, kept, room)
        results = results_of(pack, kept, inertial_type(WIDE), updates=updates)
        return _with_attitude(results, inertial.dcm) if attitude else results

    return run_packs(runs, kinds, run_pack, threads)


def inertial_of(journeys: Sequence[Journey], lengths_s: FloatArray, visited: int) -> Inertial:
    """Return what WIDE journeys sense, and their begin; with room for the attitude at ``visited`` stamps."""
    states, covariances = zip(*[journey.start for journey in journeys], strict=True)
    accel_mps2, gyro_radps = _sensed(tuple(journey.imu for journey in journeys))
    return Inertial(
        np.array(lengths_s),
        accel_mps2,
        gyro_radps,
        np.array([journey.settings.noise for journey in journeys]).T.copy(),
        np.array([np.append(state.position_m, state.velocity_mps) for state in states]).T.copy(),
        np.array([covariance.ravel() for covariance in covariances]).T.copy(),
        *_headings(journeys),
        np.empty((visited, 9, WIDE)),
    )


def _begin_nominal(w: FloatArray, states: Sequence[NavigationState]) -> None:
    """Put attitude and biases at the start into the array of the runs."""
    fields = inertial_type(WIDE).fields
    for lane, state in enumerate(states):
        begin = {"C": state.dcm, "gyro_bias": state.gyro_bias_radps, "accel_bias": state.accel_bias_mps2}
        for name, value in begin.items():
            w[np.array(fields[name].places) + lane] = value.ravel()


def _headings(journeys: Sequence[Journey]) -> tuple[IntArray, FloatArray]:
    """The row of each step, and the rows of all journeys: NaN where one has none, with a sigma of one."""
    events = np.array([journey.events.heading for journey in journeys])
    headed = np.flatnonzero((events >= 0).any(axis=0))
    rows, yaw = np.full(events.shape[1], -1, dtype=np.int64), np.ones((len(headed), 2, len(journeys)))
    rows[headed], yaw[:, 0] = np.arange(len(headed)), np.nan
    for lane, journey in enumerate(journeys):
        which = events[lane, headed]
        if journey.headings is not None:
            yaw[which >= 0, 0, lane] = journey.headings.yaw_rad[which[which >= 0]]
            yaw[which >= 0, 1, lane] = journey.headings.sigma_rad[which[which >= 0]]
    return rows, yaw


@lru_cache(maxsize=2)  # for the next adaptation
def _sensed(imus: tuple[Imu, ...]) -> tuple[FloatArray, FloatArray]:
    """Specific force and rate in vectors."""
    accel, gyro = (np.stack([getattr(imu, name) for imu in imus], axis=-1) for name in ("accel_mps2", "gyro_radps"))
    return np.ascontiguousarray(accel, np.float64), np.ascontiguousarray(gyro, np.float64)


def _with_attitude(results: Sequence[Streamed | None], dcm: FloatArray) -> list[Streamed | None]:
    euler_rad = [euler_from_rotations(dcm[:, :, lane].reshape(-1, 3, 3)) for lane in range(len(results))]
    return [r if r is None else r._replace(euler_rad=own) for r, own in zip(results, euler_rad, strict=True)]
