"""Runs from Python: one with its trajectory, or many in packs of WIDE that share their steps, one pack a thread."""

import math
import sys
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import WIDE, FloatArray, IntArray
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import Lanes
from jerkbench.contracts import Filter
from jerkbench.estimate import NEES, NEES_POSITION, SUMS, VELOCITY_SQUARES, WHOLE, Estimate, Streamed, Updates
from jerkbench.kinematic.arguments import MARKED, SEEN, Kept, Steps, TruthRows, exchange_for, run_type
from jerkbench.kinematic.loop import loop_for
from jerkbench.kinematic.packs import Kind, Pack, model_of, pack_runs, together
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.timeline import Run, Timeline

NO_ROWS = np.empty((0, 6, 1))
NO_TRUTH = TruthRows(np.empty(0, np.int64), NO_ROWS[:, 0], NO_ROWS, NO_ROWS[:, :4, 0], NO_ROWS[:, 0])


def run_single(timeline: Timeline, model: Filter, rule: Rule) -> Estimate:
    """Run ``model`` with the compiled adaptation over ``timeline``; stops at the first sign of divergence."""
    lengths_s, which = timeline.lengths
    prepared = model_of([model], lengths_s, timeline.dt0_s)
    n = 2 + len(prepared.extra)
    return run_alone(timeline, which, rule, (loop_for(n, 1, dense=rule.dense), run_type(n, 1), prepared))[0]


def run_alone(
    timeline: Timeline, which: IntArray, rule: Rule, prepared: tuple[Any, ...]
) -> tuple[Estimate, FloatArray]:
    """Run over ``timeline``, whose steps have lengths number ``which``; ``prepared`` as `Prepare` says.

    Returns:
        The estimate, and the array of the run.
    """
    loop, of, own, *more = prepared
    kept, steps = _room_of(timeline, of), _steps_of(timeline, which, wants_truth=rule.wants_truth)
    rules, room = rules_of([rule], of.sizes["s"]), exchange_for(of)
    states, updates = loop(steps, NO_TRUTH, own, rules, kept, room, *more)
    return _estimate_of(timeline, kept, states, updates, of), kept.w


def _steps_of(timeline: Timeline, which: IntArray, *, wants_truth: bool) -> Steps:
    """The steps as arrays of the layout that the compiled loop takes."""
    measured = timeline.measurements
    return Steps(
        which,
        _plain(timeline.sample, np.int64),
        _plain(timeline.update, np.int64),
        _plain(timeline.reference, np.int64),
        _plain(timeline.accel_enu_mps2, np.float64)[:, :, None],
        _plain(measured.z, np.float64)[:, :, None],
        _plain(measured.R_true[: len(measured.z) if wants_truth else 0], np.float64).reshape(-1, 36, 1),
        _plain(measured.R, np.float64).reshape(-1, 36, 1),
        np.empty((0, 1)),
        _plain(timeline.x0, np.float64)[:, None],
        _plain(timeline.P0, np.float64).reshape(36, 1),
    )


def _plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    """Make ``array`` contiguous and writeable, copied only if it is not: a compiled signature is exact."""
    flags = array.flags
    if array.dtype == dtype and flags.c_contiguous and flags.writeable and flags.aligned:
        return array
    return np.require(array, dtype, ["C", "W", "A"])


def _room_of(timeline: Timeline, of: Lanes) -> Kept:
    """Room for every stamp of the reference and every update of ``timeline``."""
    k, m = timeline.visits
    seen = max(m, 1)
    room = _last_room(k * 42 + seen * SEEN)
    return Kept(
        aligned_zeros(of.sizes["length"]),
        np.empty(k, dtype=np.int64),
        room[: k * 6].reshape(k, 6, 1),
        room[k * 6 : k * 42].reshape(k, 36, 1),
        np.empty((0, MARKED, 1)),
        np.empty(m, dtype=np.int64),
        room[k * 42 : k * 42 + seen * SEEN].reshape(seen, SEEN, 1),
    )


ROOMS: Final[list[FloatArray]] = []
"""The room of the last trajectory. The system clears new memory page by page, which takes a fifth as long as a run."""

UNSEEN = 2
"""References to a room that no trajectory looks at: a variable's, and that of the call that counts them."""


def _last_room(length: int) -> FloatArray:
    """Return room for ``length`` numbers: that of the last trajectory if it is long enough, and nobody sees it."""
    room = ROOMS.pop() if ROOMS else np.empty(0)
    if len(room) < length or sys.getrefcount(room) > UNSEEN:
        room = np.empty(length)
    ROOMS[:] = [room]
    return room


def _estimate_of(timeline: Timeline, kept: Kept, states: int, updates: int, of: Lanes) -> Estimate:
    """What a run has left."""
    failed = int(kept.w[of.fields["ended"].places[0]])
    t_s: FloatArray = np.asarray(timeline.measurements.t_ns * 1e-9, dtype=np.float64)
    failure = f"the covariance is no longer positive definite at {timeline.t_s[failed]:.2f} s" if failed >= 0 else ""
    index, x, seen = kept.reference[:states], kept.x[:states, :, 0], kept.seen[:updates, :, 0]
    return Estimate(
        index,
        x[:, :3],
        x[:, 3:],
        kept.P[:states].reshape(-1, 6, 6),
        _rows(timeline.euler_rad, index),
        updates_seen(t_s[kept.which[:updates]], seen),
        failure,
    )


def updates_seen(t_s: FloatArray, seen: FloatArray) -> Updates:
    """Return the updates at ``t_s`` (m,) from ``seen`` (m, SEEN), in the order of `jerkbench.kinematic.arguments`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log_det = np.asarray(np.log(seen[:, 16]), dtype=np.float64)
    return Updates(t_s, seen[:, 0], seen[:, 1], seen[:, 3], seen[:, 4:10], seen[:, 10:16], log_det)


def _rows(array: FloatArray, increasing: IntArray) -> FloatArray:
    """Return ``array[increasing]``; where that is all of them it is a view, which cannot be written."""
    if len(increasing) != len(array):
        return array.take(increasing, axis=0)
    view = array.view()
    view.flags.writeable = False
    return view


# Many runs from Python: packs of WIDE runs that share their steps, one pack a thread.

Prepare = Callable[[Pack, Sequence[int]], tuple[Any, ...] | None]
"""A pack, and which places of the batch its WIDE runs have -> the loop, the type of its runs, its third argument, and
those behind the sixth; None where it is not to be run so."""

MANY_RUNS = 100_000
"""After this number of runs in a process, a loop pays that is compiled for decoupled axes (it takes some 10 s)."""

RUNS_MADE: Final[list[int]] = [0]
"""The number of runs of this process so far."""

_NOTHING = Updates.empty()
OF_COVARIANCE, OF_VELOCITY = [NEES, NEES_POSITION], [*range(VELOCITY_SQUARES, WHOLE)]


def run_batch(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs``, each with its own filter and compiled adaptation.

    Returns one result for each: None where the run is to be repeated alone, because it diverged, came near to it, or
    its adaptation raised an error.
    """

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...]:
        model = model_of([models[k] for k in lanes], pack.lengths_s, pack.timelines[0].dt0_s)
        n = 2 + len(model.extra)
        first = rules[lanes[0]]
        loop = loop_for(n, WIDE, dense=first.dense, asked=first.asked, stride=3 if pack.apart else 1)
        return loop, run_type(n, WIDE), model

    sizes = [2 + len(model.initial_variances()) for model in models]
    RUNS_MADE[0] += len(runs)
    by_axes = RUNS_MADE[0] > MANY_RUNS
    return run_packs(runs, sizes, rules, prepare, updates=updates, threads=threads, by_axes=by_axes)


def run_packs(
    runs: Sequence[Run],
    sizes: Sequence[Hashable],
    rules: Sequence[Rule],
    prepare: Prepare,
    *,
    updates: bool,
    threads: int,
    by_axes: bool = False,
) -> list[Streamed | None]:
    """Pack runs that have the same ``sizes`` (of the state) and steps, and run one pack a thread.

    Returns one result for each run, as `run_batch` does. ``by_axes``: whether the loop that a pack gets goes over each
    axis by itself where the pack says so.
    """
    results: list[Streamed | None] = [None] * len(runs)

    def run_pack(pack: Pack) -> None:
        """Run one pack, filled with its last run, and put the results in their places."""
        lanes = [*pack.members, *[pack.members[-1]] * (WIDE - len(pack.members))]
        prepared = prepare(pack, lanes)
        if prepared is not None:
            loop, of, own, *more = prepared
            kept = _room_of_pack(pack, of, updates=updates)
            asked = rules_of([rules[k] for k in lanes], of.sizes["s"], 3 if pack.apart else 1)
            loop(pack.steps, pack.scored, own, asked, kept, exchange_for(of), *more)
            coupled = kept.w[of.fields["coupled"].places[0] :][:WIDE].tolist()
            if pack.apart and any(coupled):
                run_pack(together(pack))
            found = zip(pack.members, _results_of(pack, kept, of, updates=updates), coupled, strict=False)
            for place, result, again in found:
                if not again:
                    results[place] = result

    kinds = [
        Kind((size, rule.together), rule.wants_truth, rule.dense, by_axes and rule.by_axes)
        for size, rule in zip(sizes, rules, strict=True)
    ]
    packs = _packs(tuple(runs), tuple(kinds))
    if threads <= 1 or len(packs) <= 1:
        for pack in packs:
            run_pack(pack)
    else:
        list(_pool(threads).map(run_pack, packs))
    return results


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """To start threads takes as long as a run."""
    return ThreadPoolExecutor(threads, "jerkbench-runs")


_packs = lru_cache(maxsize=2)(pack_runs)  # for the next filter; some 10 MB for each vector of 150 s at 100 Hz


def _room_of_pack(pack: Pack, of: Lanes, *, updates: bool) -> Kept:
    """Room for the sums of a pack, and for what its updates saw."""
    m, marks = len(pack.steps.z), int(pack.scored.mark.max()) + 1 if any(map(len, pack.marks)) else 0
    return Kept(
        aligned_zeros(of.sizes["length"]),
        np.empty(0, dtype=np.int64),
        np.empty((0, 6, WIDE)),
        np.empty((0, 36, WIDE)),
        np.full((marks, MARKED, WIDE), np.nan),
        np.empty(m, dtype=np.int64),
        np.empty((max(m, 1) if updates else 1, SEEN, WIDE)),
    )


def _results_of(pack: Pack, kept: Kept, of: Lanes, *, updates: bool) -> list[Streamed | None]:
    """The sums of each member of a pack, NaN where nobody reads them; None where it is lost, or no number."""
    begins = (of.fields[name].places[0] for name in ("sums", "x", "lost"))
    sums, x, lost = (kept.w[begin:].reshape(-1, WIDE) for begin in begins)
    sums = sums[:SUMS].T.copy()
    healthy = np.isfinite(sums).all(axis=1) & np.isfinite(x[: of.sizes["s"]]).all(axis=0) & (lost[0] == 0.0)
    sums[:, OF_COVARIANCE * (not pack.scored.consistency) + OF_VELOCITY * (not pack.scored.speeds)] = math.nan
    return [
        _result(pack, kept, sums[lane], lane, updates=updates) if well else None
        for lane, well in enumerate(healthy[: len(pack.members)].tolist())
    ]


def _result(pack: Pack, kept: Kept, sums: FloatArray, lane: int, *, updates: bool) -> Streamed:
    seen = _updates(pack, kept.seen, lane) if updates else _NOTHING
    errors = kept.errors[:, :, lane]
    return Streamed.of(sums, errors[pack.marks[lane]] if len(errors) else errors, seen)


def _updates(pack: Pack, seen: FloatArray, lane: int) -> Updates:
    """What the updates of one run saw; it may lack some that others have."""
    seen = seen[: len(pack.steps.z)]  # of no update there is a row all the same
    mine = seen[:, 0, lane] > 0
    return updates_seen(pack.update_s[mine], seen[mine, :, lane])
