"""One run: the steps of a timeline, one after the other."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import WIDTH, vectors
from jerkbench.engines.compiled.arguments import Kept, Model, Packed, Rule, Steps
from jerkbench.engines.compiled.places import N, X
from jerkbench.engines.compiled.single.adapt import adapt_rows
from jerkbench.engines.compiled.single.covariance import definite, pairs_to_square, square_to_pairs, store_measured
from jerkbench.engines.compiled.single.measure import innovate, keep_used
from jerkbench.engines.compiled.single.places import ADAPTED, AXES, PAIRS, SAME, SEEN_HPHT, SEEN_R, SEEN_Y, S
from jerkbench.engines.compiled.single.predict import predict
from jerkbench.engines.compiled.single.update import correct


def run_steps(
    steps: Steps, model: Model, rule: Rule, kept: Kept, m: FloatArray, rows: IntArray
) -> tuple[int, int, int]:
    """Run all steps.

    Args:
        steps: the steps.
        model: the filter.
        rule: the adaptation.
        kept: gets what comes out.
        m: (LENGTH,) zeros, in which the run lives.
        rows: (6,) room.

    Returns:
        How many states and updates there are, and the update at which the run failed, or -1.
    """
    w, packed = vectors(m), make_packed(m, rows)
    start(m, model)
    states = updates = 0
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            predict(w, m, model, steps, k)
        if steps.update[k] >= 0:
            healthy = update(w, m, packed, steps, rule, kept, steps.update[k], updates)
            updates += 1
            if not healthy:
                return states, updates, steps.update[k]
        if steps.reference[k] >= 0:
            kept.reference[states] = steps.reference[k]
            for s in range(6):
                kept.x[states, s] = m[X + s]
            store_measured(w, kept.P, states)
            states += 1
    return states, updates, -1


def start(m: FloatArray, model: Model) -> None:
    """Put the initial state and covariance into m, which is zero."""
    for p in range(6):
        m[WIDTH * SAME + p] = 1.0 if AXES[p][0] == AXES[p][1] else 0.0
    for s in range(S):
        m[X + s] = model.x0[s]
    for e in range(N * N):
        for p in range(6):
            m[PAIRS + WIDTH * e + p] = model.P0[3 * (e // N) + AXES[p][0], 3 * (e % N) + AXES[p][1]]


def make_packed(m: FloatArray, rows: IntArray) -> Packed:
    """Point at what an adaptation sees, and at room for what it says."""
    y, HPHt, given = m[SEEN_Y : SEEN_Y + 6], m[SEEN_HPHT : SEEN_HPHT + 36], m[SEEN_R : SEEN_R + 36]
    return Packed(rows, y, HPHt, given, m[ADAPTED : ADAPTED + 36])


def update(
    w: FloatArray,
    m: FloatArray,
    packed: Packed,
    steps: Steps,
    rule: Rule,
    kept: Kept,
    which: int,
    place: int,
) -> bool:
    """Adapt R, update, keep what was seen at ``place``; False where the filter has diverged."""
    pairs_to_square(m)
    rows = innovate(m, packed, steps.z, which)
    kept.which[place], kept.rows[place] = which, rows
    same = adapt_rows(m, packed, steps, rule, kept, which, place, rows)
    left = keep_used(m, packed, kept, place, rows)
    kept.nis_used[place] = correct(w, m) if left > 0 else np.nan
    if same:
        kept.nis[place] = kept.nis_used[place]
    square_to_pairs(m)
    return finite(m) and definite(w, m)


def finite(m: FloatArray) -> bool:
    """Whether the state is."""
    total = 0.0
    for s in range(S):
        total += m[X + s] * 0.0
    return total == 0.0
