"""Mixtures from Python: a timeline in, an estimate or sums out."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray
from jerkbench.batch import Scoring, Streamed
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.contracts import Adaptation, Filter
from jerkbench.estimate import Estimate, Updates
from jerkbench.estimation.adaptation_call import rule_of
from jerkbench.estimation.sums import SEEN, Score, score_of, streamed_from
from jerkbench.linear.arguments import Kept, Models, Steps
from jerkbench.linear.entry import mixture_for
from jerkbench.linear.layout import LARGEST, places
from jerkbench.optional import axis_models, wants_truth
from jerkbench.timeline.lengths import step_lengths
from jerkbench.timeline.timeline import Timeline


class Mixed(NamedTuple):
    """The begin of a mixture of k filters with n states.

    Attributes:
        filters: the k filters.
        transitions: (k, k) Pi.
        weights: (k,) c.
        x: (k, n) mixed states.
        P: (k, n, n) their covariances.
    """

    filters: tuple[Filter, ...]
    transitions: FloatArray
    weights: FloatArray
    x: FloatArray
    P: FloatArray


def mix_compiled(timeline: Timeline, start: Mixed, adaptation: Adaptation) -> Estimate | None:
    """Run with a trajectory; None where that cannot be compiled: the adaptation, or filters with so many states."""
    k, m = int(np.count_nonzero(timeline.reference >= 0)), int(np.count_nonzero(timeline.update >= 0))
    kept = _make_kept(k, m)
    end = _run(timeline, start, adaptation, kept, score_of(None, timeline))
    if end is None:
        return None
    states, updates, failed = end
    failure = f"a covariance is no longer positive definite at {timeline.t_s[failed]:.2f} s" if failed >= 0 else ""
    index, x = kept.reference[:states], kept.x[:states]
    P, seen = kept.P[:states].reshape(-1, 6, 6), _updates(timeline, kept, updates)
    return Estimate(index, x[:, :3], x[:, 3:], P, timeline.euler_rad[index], seen, failure)


def stream_mixture(
    timeline: Timeline, scoring: Scoring, start: Mixed, adaptation: Adaptation, *, updates: bool
) -> Streamed | None:
    """Run without a trajectory; None where that needs one, or cannot be compiled, or the run is lost."""
    score = score_of(scoring, timeline)
    kept = _make_kept(0, int(np.count_nonzero(timeline.update >= 0)) if updates else 0)
    end = _run(timeline, start, adaptation, kept, score)
    if end is None or end[2] >= 0 or end[0] != len(scoring.truth):
        return None
    return streamed_from(score, scoring, _updates(timeline, kept, end[1]) if updates else Updates.empty(), None)


def _run(
    timeline: Timeline, start: Mixed, adaptation: Adaptation, kept: Kept, score: Score
) -> tuple[int, int, int] | None:
    """Numbers of states and updates, and the step at which it failed, or -1; None where it cannot be compiled."""
    states = start.x.shape[1]
    rule = rule_of(adaptation) if states <= LARGEST else None
    if rule is None:
        return None
    lengths_s, which = step_lengths(timeline.dt_s)
    measured = timeline.measurements
    steps = Steps(
        which,
        _plain(timeline.sample, np.int64),
        _plain(timeline.update, np.int64),
        _plain(timeline.reference, np.int64),
        _plain(timeline.accel_enu_mps2, np.float64),
        _plain(measured.z, np.float64),
        _plain(measured.covariances(true=wants_truth(adaptation)), np.float64),
        _plain(measured.R, np.float64),
    )
    arrays = zip(*(axis_models(model, lengths_s, timeline.dt0_s) for model in start.filters), strict=True)
    A, b, Q = (np.stack(parts) for parts in arrays)
    n = len(start.filters)
    models = Models(A, b, Q, _plain(start.transitions, np.float64), start.weights.copy(), np.zeros(n), np.zeros(n))
    end: tuple[int, int, int] = mixture_for(states)(steps, models, rule, kept, score, _rooms(start))
    return end


def _plain(array: Any, dtype: npt.DTypeLike) -> Any:  # noqa: ANN401 - any array
    return np.require(array, dtype, ["C", "W", "A"])


def _rooms(start: Mixed) -> FloatArray:
    """The arrays in which the filters live, and one for their mixture."""
    k, states = start.x.shape
    at = places(states)
    length = -(-at["LENGTH"] // WIDE) * WIDE
    rooms = aligned_zeros((k + 1) * length).reshape(k + 1, length)
    for room, x, P in zip(rooms, start.x, start.P, strict=False):
        room[at["X"] : at["X"] + states] = x
        room[at["P_AT"] : at["P_AT"] + states * at["STRIDE"]].reshape(states, -1)[:, :states] = P
    return rooms


def _make_kept(references: int, updates: int) -> Kept:
    k, m = max(references, 1), max(updates, 1)
    places_of = np.zeros((2, 6), dtype=np.int64)
    reference, which = np.empty(k, dtype=np.int64), np.empty(m, dtype=np.int64)
    return Kept(reference, np.empty((k, 6)), np.empty((k, 36)), which, np.empty((m, SEEN)), *places_of)


def _updates(timeline: Timeline, kept: Kept, taken: int) -> Updates:
    seen, t_s = kept.seen[:taken], np.asarray(timeline.measurements.t_ns[kept.which[:taken]] * 1e-9)
    return Updates(t_s, seen[:, 0], seen[:, 1], seen[:, 3], seen[:, 4:10], seen[:, 10:])
