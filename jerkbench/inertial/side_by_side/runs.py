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
from jerkbench.inertial.side_by_side.loop import QUANTITIES, Inertial, inertial_type, run_together
from jerkbench.inertial.state import STATES
from jerkbench.kinematic.batch import run_packs
from jerkbench.kinematic.loop import APART
from jerkbench.kinematic.packs import Pack
from jerkbench.kinematic.plugin_call import Rule
from jerkbench.recording import Imu
from jerkbench.sums import Run, Scoring, Streamed

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
    attitudes: dict[int, FloatArray] = {}

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...]:
        visited = len(pack.score.truth) if attitude else 0
        inertial = inertial_of([journeys[k] for k in lanes], pack.lengths_s, visited)
        attitudes.update((k, inertial.dcm[:, :, lane]) for lane, k in enumerate(pack.members))
        return loop_together(), inertial_type(WIDE), inertial

    results = run_packs(runs, [QUANTITIES] * len(runs), rules, prepare, updates=updates, threads=threads)
    if not attitude:
        return results
    euler_rad = [euler_from_rotations(attitudes[k].reshape(-1, 3, 3)) for k in range(len(runs))]
    return [r if r is None else r._replace(euler_rad=own) for r, own in zip(results, euler_rad, strict=True)]


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
        np.array([state.dcm.ravel() for state in states]).T.copy(),
        np.array([np.append(state.gyro_bias_radps, state.accel_bias_mps2) for state in states]).T.copy(),
        np.array([covariance.ravel() for covariance in covariances]).T.copy(),
        *_headings(journeys),
        np.empty((visited, 9, WIDE)),
    )


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
