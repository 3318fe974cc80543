"""One run from Python: a timeline in, an Estimate with its trajectory out."""

from typing import Any

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Updates
from jerkbench.kinematic.arguments import MARKED, SEEN, Kept, Score, Steps, empty_runs
from jerkbench.kinematic.compiled_loop import loop_for
from jerkbench.kinematic.layout import run_type
from jerkbench.kinematic.models import model_of
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.timeline.lengths import step_lengths
from jerkbench.timeline.timeline import Timeline

NO_SCORE = Score(np.empty(0, dtype=np.int64), np.empty((0, 1)), np.empty((0, 6, 1)), np.empty((0, 4)), np.empty((0, 1)))


def run_single(timeline: Timeline, model: Filter, rule: Rule) -> Estimate:
    """Run ``model`` with the compiled adaptation over ``timeline``; stops at the first sign of divergence."""
    lengths_s, which = step_lengths(timeline.dt_s)
    prepared = model_of([model], lengths_s, timeline.dt0_s)
    n = 2 + len(prepared.extra)
    kept = trajectory_room(timeline, n)
    entry = loop_for(n, 1, dense=rule.dense)
    steps = steps_of(timeline, which, wants_truth=rule.wants_truth)
    states, updates = entry(steps, NO_SCORE, prepared, rules_of([rule], 3 * n), kept, empty_runs(n, 1))
    return estimate_of(timeline, kept, states, updates, n)


def steps_of(timeline: Timeline, which: IntArray, *, wants_truth: bool) -> Steps:
    """Return the steps as arrays of the layout that the compiled loop takes."""
    measured = timeline.measurements
    return Steps(
        which,
        plain(timeline.sample, np.int64),
        plain(timeline.update, np.int64),
        plain(timeline.reference, np.int64),
        plain(timeline.accel_enu_mps2, np.float64)[:, :, None],
        plain(measured.z, np.float64)[:, :, None],
        plain(measured.R_true[: len(measured.z) if wants_truth else 0], np.float64).reshape(-1, 36, 1),
        plain(measured.R, np.float64).reshape(-1, 36, 1),
        plain(timeline.x0, np.float64)[:, None],
        plain(timeline.P0, np.float64).reshape(36, 1),
    )


def plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    """Return ``array`` contiguous and writeable, copied only if it is not: a compiled signature is exact."""
    flags = array.flags
    if array.dtype == dtype and flags.c_contiguous and flags.writeable and flags.aligned:
        return array
    return np.require(array, dtype, ["C", "W", "A"])


def trajectory_room(timeline: Timeline, n: int) -> Kept:
    """Make room for every stamp of the reference and every update of ``timeline``."""
    k, m = int(np.count_nonzero(timeline.reference >= 0)), int(np.count_nonzero(timeline.update >= 0))
    return Kept(
        aligned_zeros(run_type(n, 1).sizes["length"]),
        np.empty(k, dtype=np.int64),
        np.empty((k, 6, 1)),
        np.empty((k, 36, 1)),
        np.empty((0, MARKED, 1)),
        np.empty(m, dtype=np.int64),
        np.empty((max(m, 1), SEEN, 1)),
    )


def estimate_of(timeline: Timeline, kept: Kept, states: int, updates: int, n: int) -> Estimate:
    """Return what a run of a filter with ``n`` quantities on each axis has left."""
    failed = int(kept.w[run_type(n, 1).fields["ended"].places[0]])
    t_s: FloatArray = np.asarray(timeline.measurements.t_ns * 1e-9, dtype=np.float64)
    failure = f"the covariance is no longer positive definite at {t_s[failed]:.2f} s" if failed >= 0 else ""
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
