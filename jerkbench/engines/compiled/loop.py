"""One run: the steps of a timeline, one after the other."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.engines.compiled.correct import correct, mahalanobis
from jerkbench.engines.compiled.layouts import blocks_to_square, square_to_blocks, store_measured
from jerkbench.engines.compiled.predict import (
    predict_general,
    predict_state,
    predict_state_triangular,
    predict_triangular,
)
from jerkbench.engines.compiled.sizes import KEPT, LENGTH, P, R, S, X, Y
from jerkbench.engines.compiled.solve import positive_definite

Adapt = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray], None]
Fade = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray], float]


class Steps(NamedTuple):
    """The steps of a run, as in `jerkbench.timeline.timeline.Timeline`.

    Attributes:
        model: (n,) which row of A, b, Q belongs to the step, or -1: no time passes.
        sample: (n,) row of u.
        update: (n,) row of z, or -1.
        reference: (n,) row of the reference, or -1.
        u: (samples, 3) the input.
        z: (m, 6) measurements, NaN where there is none.
        R: (m, 36) what the adaptation gets.
        reported: (m, 36) what the receiver reported.
    """

    model: IntArray
    sample: IntArray
    update: IntArray
    reference: IntArray
    u: FloatArray
    z: FloatArray
    R: FloatArray
    reported: FloatArray


class Model(NamedTuple):
    """The filter.

    Attributes:
        A: (k, N, N) of one axis, for each length of a step.
        b: (k, N) likewise.
        Q: (k, N, N) likewise.
        x0: (S,) initial state.
        P0: (S, S) its covariance.
        triangular: whether every A is upper triangular with ones on its diagonal.
    """

    A: FloatArray
    b: FloatArray
    Q: FloatArray
    x0: FloatArray
    P0: FloatArray
    triangular: bool


class Rule(NamedTuple):
    """The adaptation.

    Attributes:
        parameters: its numbers.
        memory: what it remembers, zero.
        fades: whether it has a `fade`.
    """

    parameters: FloatArray
    memory: FloatArray
    fades: bool


class Kept(NamedTuple):
    """Room for what a run produces, as in `jerkbench.estimate`.

    Attributes:
        reference: (k,) its rows.
        x: (k, 6) position and velocity.
        P: (k, 36) their covariance.
        which: (m,) rows of z.
        rows: (m,) number of rows of each update.
        nis: (m,) with the reported R.
        nis_used: (m,) with the R that was used.
        innovation: (m, 6), NaN.
        R: (m, 6) diagonal, NaN.
    """

    reference: IntArray
    x: FloatArray
    P: FloatArray
    which: IntArray
    rows: FloatArray
    nis: FloatArray
    nis_used: FloatArray
    innovation: FloatArray
    R: FloatArray


class Packed(NamedTuple):
    """What an adaptation sees of the m rows that are there.

    Attributes:
        rows: (6,) the first m: which rows of z they are.
        y: (6,) the first m: innovation.
        HPHt: (36,) the first m m.
        R: (36,) the first m m.
        adapted: (36,) the first m m: what the adaptation returns.
        HPHt_of_six: (6, 6) the same memory as HPHt, for an update with all rows; so are the next two.
        R_of_six: (6, 6).
        adapted_of_six: (6, 6).
    """

    rows: IntArray
    y: FloatArray
    HPHt: FloatArray
    R: FloatArray
    adapted: FloatArray
    HPHt_of_six: FloatArray
    R_of_six: FloatArray
    adapted_of_six: FloatArray


def run_steps(adapt: Adapt, fade: Fade, steps: Steps, model: Model, rule: Rule, kept: Kept) -> tuple[int, int, int]:
    """Fill ``kept``; return how many states and updates there are, and the update at which the run failed, or -1."""
    w = start(model)
    HPHt, given, adapted = np.zeros(36), np.zeros(36), np.zeros(36)
    of_six = HPHt.reshape(6, 6), given.reshape(6, 6), adapted.reshape(6, 6)
    packed = Packed(np.zeros(6, dtype=np.int64), np.zeros(6), HPHt, given, adapted, *of_six)
    states = updates = 0
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            predict(w, model, steps, k)
        if steps.update[k] >= 0:
            healthy = update(adapt, fade, w, packed, steps, rule, kept, steps.update[k], updates)
            updates += 1
            if not healthy:
                return states, updates, steps.update[k]
        if steps.reference[k] >= 0:
            kept.reference[states] = steps.reference[k]
            for s in range(6):
                kept.x[states, s] = w[X + s]
            store_measured(w, kept.P, states)
            states += 1
    return states, updates, -1


def start(model: Model) -> FloatArray:
    """Return w with the initial state and covariance."""
    w = np.zeros(LENGTH)
    for s in range(S):
        w[X + s] = model.x0[s]
        for t in range(S):
            w[P + S * s + t] = model.P0[s, t]
    square_to_blocks(w)
    return w


def predict(w: FloatArray, model: Model, steps: Steps, k: int) -> None:
    """Predict over step ``k``."""
    m, sample = steps.model[k], steps.sample[k]
    if model.triangular:
        predict_state_triangular(w, model.A, model.b, m, steps.u, sample)
        predict_triangular(w, model.A, model.Q, m)
    else:
        predict_state(w, model.A, model.b, m, steps.u, sample)
        predict_general(w, model.A, model.Q, m)


def update(
    adapt: Adapt,
    fade: Fade,
    w: FloatArray,
    packed: Packed,
    steps: Steps,
    rule: Rule,
    kept: Kept,
    which: int,
    place: int,
) -> bool:
    """Adapt R, update, keep what was seen at ``place``; False where the filter has diverged."""
    blocks_to_square(w)
    m = _innovate(w, packed, steps.z, which)
    kept.which[place], kept.rows[place] = which, m
    for e in range(36):
        w[R + e] = steps.reported[which, e]
    if rule.fades:  # it changes P
        kept.nis[place] = mahalanobis(w)
    if m == 6:
        _adapt_six(adapt, fade, w, packed, steps.R, which, rule)
    else:
        _adapt_some(adapt, fade, w, packed, steps.R, which, rule, m)
    unchanged = not rule.fades and _unchanged(w, packed, m)
    if not rule.fades and not unchanged:
        kept.nis[place] = mahalanobis(w)
    _take_adapted(w, packed, m)
    dropped = 0
    for i in range(m):
        r = packed.rows[i]
        kept.innovation[place, r] = w[Y + r]
        kept.R[place, r] = w[R + 7 * r]
        if not np.isfinite(w[R + 7 * r]):
            dropped += 1
            _drop(w, r)
    kept.nis_used[place] = correct(w) if dropped < m else np.nan
    if unchanged:
        kept.nis[place] = kept.nis_used[place]
    square_to_blocks(w)
    return _healthy(w)


def _innovate(w: FloatArray, packed: Packed, z: FloatArray, which: int) -> int:
    """Fill y, kept and rows; return the number of rows that are there."""
    m = 0
    for r in range(6):
        there = np.isfinite(z[which, r])
        w[KEPT + r] = 1.0 if there else 0.0
        w[Y + r] = z[which, r] - w[X + r] if there else 0.0
        if there:
            packed.rows[m], packed.y[m] = r, w[Y + r]
            m += 1
    return m


def _adapt_six(
    adapt: Adapt, fade: Fade, w: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule
) -> None:
    """Call the adaptation with all six rows."""
    for i in range(6):
        for j in range(6):
            packed.HPHt[6 * i + j] = w[P + S * i + j]
            packed.R[6 * i + j] = given[which, 6 * i + j]
    y, HPHt, reported = packed.y, packed.HPHt_of_six, packed.R_of_six
    if rule.fades:
        _fade(w, packed, fade(rule.parameters, y, HPHt, reported, packed.rows, rule.memory))
    adapt(rule.parameters, y, HPHt, reported, packed.rows, rule.memory, packed.adapted_of_six)


def _adapt_some(
    adapt: Adapt, fade: Fade, w: FloatArray, packed: Packed, given: FloatArray, which: int, rule: Rule, m: int
) -> None:
    """Call the adaptation with the m rows that are there."""
    for i in range(m):
        for j in range(m):
            packed.HPHt[m * i + j] = w[P + S * packed.rows[i] + packed.rows[j]]
            packed.R[m * i + j] = given[which, 6 * packed.rows[i] + packed.rows[j]]
    y, rows = packed.y[:m], packed.rows[:m]
    HPHt, reported = packed.HPHt[: m * m].reshape(m, m), packed.R[: m * m].reshape(m, m)
    if rule.fades:
        _fade(w, packed, fade(rule.parameters, y, HPHt, reported, rows, rule.memory))
    adapt(rule.parameters, y, HPHt, reported, rows, rule.memory, packed.adapted[: m * m].reshape(m, m))


def _fade(w: FloatArray, packed: Packed, factor: float) -> None:
    """Scale the prior covariance, and what the adaptation will see of it."""
    for e in range(S * S):
        w[P + e] *= factor
    for e in range(36):
        packed.HPHt[e] *= factor


def _unchanged(w: FloatArray, packed: Packed, m: int) -> bool:
    """Whether the adapted R is the reported one, so that one NIS serves as both."""
    if m < 6:
        return False
    same = True
    for e in range(36):
        same &= packed.adapted[e] == w[R + e]
    return same


def _take_adapted(w: FloatArray, packed: Packed, m: int) -> None:
    """Put what the adaptation says into R, zero where a row is not there."""
    for e in range(36):
        w[R + e] = packed.adapted[e] if m == 6 else 0.0
    if m < 6:
        for i in range(m):
            for j in range(m):
                w[R + 6 * packed.rows[i] + packed.rows[j]] = packed.adapted[m * i + j]


def _drop(w: FloatArray, r: int) -> None:
    """Leave row ``r`` out of the update."""
    w[KEPT + r] = 0.0
    w[Y + r] = 0.0
    for c in range(6):
        w[R + 6 * r + c] = 0.0
        w[R + 6 * c + r] = 0.0


def _healthy(w: FloatArray) -> bool:
    """Whether the state is finite and the covariance positive definite."""
    total = 0.0
    for s in range(S):
        total += w[X + s] * 0.0
    return total == 0.0 and positive_definite(w)
