"""One run from Python: a timeline in, an Estimate with its trajectory out."""

from typing import Any

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import RunView
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Updates
from jerkbench.kinematic.arguments import MARKED, SEEN, Kept, Score, Steps, empty_runs
from jerkbench.kinematic.layout import run_type
from jerkbench.kinematic.loop import loop_for
from jerkbench.kinematic.models import model_of
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.timeline import Timeline, step_lengths

NO_SCORE = Score(np.empty(0, dtype=np.int64), np.empty((0, 1)), np.empty((0, 6, 1)), np.empty((0, 4)), np.empty((0, 1)))


def run_single(timeline: Timeline, model: Filter, rule: Rule) -> Estimate:
    """Run ``model`` with the compiled adaptation over ``timeline``; stops at the first sign of divergence."""
    lengths_s, which = step_lengths(timeline.dt_s)
    prepared = model_of([model], lengths_s, timeline.dt0_s)
    n = 2 + len(prepared.extra)
    return run_alone(timeline, which, rule, (loop_for(n, 1, dense=rule.dense), run_type(n, 1), prepared))[0]


def run_alone(
    timeline: Timeline, which: IntArray, rule: Rule, prepared: tuple[Any, ...]
) -> tuple[Estimate, FloatArray]:
    """Run over ``timeline``, whose steps have lengths number ``which``; ``prepared`` as in `batch`.

    Returns:
        The estimate, and the array of the run.
    """
    loop, of, own, *more = prepared
    kept, steps = _room_of(timeline, of), _steps_of(timeline, which, wants_truth=rule.wants_truth)
    rules, room = rules_of([rule], of.sizes["s"]), empty_runs(of.sizes["n"], 1)
    states, updates = loop(steps, NO_SCORE, own, rules, kept, room, *more)
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
        _plain(timeline.x0, np.float64)[:, None],
        _plain(timeline.P0, np.float64).reshape(36, 1),
    )


def _plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    """Make ``array`` contiguous and writeable, copied only if it is not: a compiled signature is exact."""
    flags = array.flags
    if array.dtype == dtype and flags.c_contiguous and flags.writeable and flags.aligned:
        return array
    return np.require(array, dtype, ["C", "W", "A"])


def _room_of(timeline: Timeline, of: RunView) -> Kept:
    """Room for every stamp of the reference and every update of ``timeline``."""
    k, m = int(np.count_nonzero(timeline.reference >= 0)), int(np.count_nonzero(timeline.update >= 0))
    return Kept(
        aligned_zeros(of.sizes["length"]),
        np.empty(k, dtype=np.int64),
        np.empty((k, 6, 1)),
        np.empty((k, 36, 1)),
        np.empty((0, MARKED, 1)),
        np.empty(m, dtype=np.int64),
        np.empty((max(m, 1), SEEN, 1)),
    )


def _estimate_of(timeline: Timeline, kept: Kept, states: int, updates: int, of: RunView) -> Estimate:
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
    """Return ``array[increasing]``, quicker; where these are all of its rows it is a view, which cannot be written."""
    if len(increasing) != len(array) or (increasing != np.arange(len(array))).any():
        return array.take(increasing, axis=0)
    view = array.view()
    view.flags.writeable = False
    return view
