"""WIDTH runs: the steps of their common timeline, one after the other."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import fetch
from jerkbench.compilation.vectors import vectors
from jerkbench.engines.compiled.arguments import Packed, Rule
from jerkbench.engines.compiled.lanes.arguments import LaneKept, LaneModel, LaneSteps
from jerkbench.engines.compiled.lanes.measure import update
from jerkbench.engines.compiled.lanes.places import OUTAGE, SQUARE
from jerkbench.engines.compiled.lanes.predict import predict
from jerkbench.engines.compiled.lanes.score import score
from jerkbench.engines.compiled.places import AT, X

AHEAD = 64
"""So many rows before it is needed the memory is asked for it: about ten microseconds."""


def run_lanes(steps: LaneSteps, model: LaneModel, rule: Rule, kept: LaneKept) -> None:
    """Run all steps; what comes out lies in ``kept``. Each run has its own memory, not that of ``rule``."""
    w, u, errors = vectors(kept.w), vectors(steps.u), vectors(kept.errors)
    truth, room = vectors(steps.truth), kept.room
    packed = Packed(kept.rows, room[108:114], room[:36], room[36:72], room[72:108])
    start(w, vectors(steps.x0), vectors(steps.P0), model.extra)
    columns = 3 * model.A.shape[1]
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            ask_ahead(u, 3, steps.sample[k])
            predict(w, model.A, model.b, model.Q, steps.model[k], u, steps.sample[k])
        if steps.update[k] >= 0:
            update(w, steps, rule, kept, packed, steps.update[k], columns)
        if steps.reference[k] >= 0:
            ask_ahead(truth, 6, steps.reference[k])
            compare(w, steps, truth, errors, steps.reference[k])


def ask_ahead(array: FloatArray, length: int, row: int) -> None:
    """Ask for a row of ``length`` vectors that a later step will read."""
    for e in range(length):
        fetch(array, length * (row + AHEAD) + e)


def compare(w: FloatArray, steps: LaneSteps, truth: FloatArray, errors: FloatArray, row: int) -> None:
    """Score the state with row ``row`` of ``truth``."""
    if steps.mark[row] >= 0:
        for i in range(3):
            errors[3 * steps.mark[row] + i] = w[X + i] - truth[6 * row + i]
    score(w, truth, row, steps.weights)
    if len(steps.outage):
        w[OUTAGE] += vectors(steps.outage)[row] * w[SQUARE]


def start(w: FloatArray, x0: FloatArray, P0: FloatArray, extra: FloatArray) -> None:
    """Put the initial state and covariance into w, which is zero."""
    for s in range(6):
        w[X + s] = x0[s]
        for t in range(6):
            w[AT[s, t]] = P0[6 * s + t]
    for a in range(len(extra)):
        for i in range(3):
            w[AT[6 + 3 * a + i, 6 + 3 * a + i]] = extra[a]
