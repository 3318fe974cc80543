"""One run from Python: arrays in, an Estimate out."""

from typing import Any

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Adaptation, Filter
from jerkbench.engines.compiled.arguments import Kept, Rule, Steps
from jerkbench.engines.compiled.models import model_of, step_lengths
from jerkbench.engines.compiled.single.entry import loop_for
from jerkbench.engines.compiled.single.places import room
from jerkbench.estimate import Estimate, Updates
from jerkbench.timeline.timeline import Timeline


def run_single(timeline: Timeline, model: Filter, adaptation: Adaptation, rule: Rule) -> Estimate:
    """Run ``model`` with the compiled adaptation over ``timeline``; stops at the first sign of divergence."""
    lengths_s, which = step_lengths(timeline.dt_s)
    steps = steps_of(timeline, which, wants_truth=getattr(adaptation, "wants_true_covariance", False))
    prepared, kept = model_of(timeline, model, lengths_s), make_kept(timeline)
    n = prepared.A.shape[1]
    rooms = room(n), np.zeros(6, dtype=np.int64)
    entry = loop_for(n)
    states, updates, failed = entry(steps, prepared, rule, kept, *rooms)
    return _estimate(timeline, kept, states, updates, failed)


def steps_of(timeline: Timeline, which: Any, *, wants_truth: bool) -> Steps:  # noqa: ANN401 - an array
    """Return the steps as arrays of the layout that the compiled loop takes."""
    measured = timeline.measurements
    R = measured.R_true if wants_truth else measured.R
    return Steps(
        which,
        plain(timeline.sample, np.int64),
        plain(timeline.update, np.int64),
        plain(timeline.reference, np.int64),
        plain(timeline.accel_enu_mps2, np.float64),
        plain(measured.z, np.float64),
        plain(R, np.float64),
        plain(measured.R, np.float64),
    )


def plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    """Return ``array`` contiguous and writeable, copied only if it is not: a compiled signature is exact."""
    flags = array.flags
    if array.dtype == dtype and flags.c_contiguous and flags.writeable and flags.aligned:
        return array
    return np.require(array, dtype, ["C", "W", "A"])


def make_kept(timeline: Timeline) -> Kept:
    """Make room for every stamp of the reference and every update of ``timeline``."""
    k, m = int(np.count_nonzero(timeline.reference >= 0)), int(np.count_nonzero(timeline.update >= 0))
    nothing = np.full((2, m, 6), np.nan)
    return Kept(
        np.empty(k, dtype=np.int64),
        np.empty((k, 6)),
        np.empty((k, 36)),
        np.empty(m, dtype=np.int64),
        np.empty(m),
        np.empty(m),
        np.empty(m),
        nothing[0],
        nothing[1],
    )


def _estimate(timeline: Timeline, kept: Kept, states: int, updates: int, failed: int) -> Estimate:
    t_s: FloatArray = np.asarray(timeline.measurements.t_ns * 1e-9, dtype=np.float64)
    failure = f"the covariance is no longer positive definite at {t_s[failed]:.2f} s" if failed >= 0 else ""
    m, index, x = updates, kept.reference[:states], kept.x[:states]
    seen = (kept.rows, kept.nis, kept.nis_used, kept.innovation, kept.R)
    return Estimate(
        index,
        x[:, :3],
        x[:, 3:],
        kept.P[:states].reshape(-1, 6, 6),
        _rows(timeline.euler_rad, index),
        Updates(t_s[kept.which[:m]], *(array[:m] for array in seen)),
        failure,
    )


def _rows(array: FloatArray, increasing: IntArray) -> FloatArray:
    """Return ``array[increasing]``, quicker; where these are all of its rows it is a view, which cannot be written."""
    if len(increasing) != len(array) or (increasing != np.arange(len(array))).any():
        return array.take(increasing, axis=0)
    view = array.view()
    view.flags.writeable = False
    return view
