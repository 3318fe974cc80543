"""The score: what a row of the reference adds to the sums of a run."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import RunView, View, room, row
from jerkbench.kinematic.arguments import Score


def compare(run: RunView, score: Score, errors: FloatArray, k: int) -> None:
    """Score the state with row ``k`` of the reference."""
    add_row(run, row(score.truth, k, run, "6"), score.weights[k])
    if score.mark[k] >= 0:
        marked = row(errors, score.mark[k], run, "9")
        for i in range(3):
            marked[i], marked[3 + i] = run.e[i], run.P[0, i]
        marked[6], marked[7], marked[8] = run.P[1, 1], run.P[1, 2], run.P[2, 2]
    if len(score.outage) > 0:
        run.outage += row(score.outage, k, run, "1")[0] * run.square


def add_row(run: RunView, truth: View, weights: FloatArray) -> None:
    """Add the errors of the state to the sums; ``weights`` (4,) in the order of `layout.WEIGHTS`."""
    counted, whole, moving = weights[0], weights[1], weights[2]
    for s in range(6):
        run.e[s] = run.x[s] - truth[s]
    for i in range(3):
        run.position[i] += counted * (run.e[i] * run.e[i])
        run.velocity[i] += moving * (run.e[3 + i] * run.e[3 + i])
    square = run.e[0] * run.e[0] + run.e[1] * run.e[1] + run.e[2] * run.e[2]
    run.square = square
    run.whole += whole * square
    run.farthest = chosen(square, run.farthest, square, run.farthest)
    run.largest = chosen(counted * square, run.largest, square, run.largest)
    _add_nees(run, counted, weights[3])


def _add_nees(run: RunView, counted: float, both: float) -> None:
    """Add e' P^-1 e of position, and of position and velocity, by elimination."""
    C, e, total = room(run, "6 6"), room(run, "6"), run.zero
    for r in range(6):
        e[r] = run.e[r]
        for c in range(r, 6):
            C[r, c] = run.P[r, c]
    for c in range(6):
        pivot = C[c, c]
        run.lost += chosen(pivot, 0.0, 0.0, 1.0)
        scale = 1.0 / pivot
        scaled = e[c] * scale
        total += e[c] * scaled
        for r in range(c + 1, 6):
            e[r] -= C[c, r] * scaled
            factor = C[c, r] * scale
            for j in range(r, 6):
                C[r, j] -= factor * C[c, j]
        if c == 2:
            run.nees_position += counted * total
    run.nees += both * total
