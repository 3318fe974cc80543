"""The smoothed position and velocity, from the filtered state and the adjoint: x - P lambda, P - P Lambda P."""

from jerkbench.compilation.views import Run, View, copy, eights, room, wide_room


def smooth(run: Run, filtered: Run, a: Run) -> None:
    """Put them into ``run``."""
    weighed = room(run, "s")
    for s in range(6):
        moved = filtered.P[s, 0] * a.x[0]
        for t in range(1, run.s):
            moved += filtered.P[s, t] * a.x[t]
        run.x[s] = filtered.x[s] - moved
    for s in range(6):
        for r in range(run.s):  # Lambda P, column s
            total = a.P[r, 0] * filtered.P[s, 0]
            for t in range(1, run.s):
                total += a.P[r, t] * filtered.P[s, t]
            weighed[r] = total
        for r in range(s + 1):
            total = filtered.P[r, 0] * weighed[0]
            for t in range(1, run.s):
                total += filtered.P[r, t] * weighed[t]
            run.P[s, r] = filtered.P[s, r] - total


def smooth_alone(x: View, P: View, filtered: Run, a: Run) -> None:
    """Put them into a row of a trajectory: the same of one run, six columns at a time."""
    columns, weighed = room(filtered, "s 8"), wide_room(filtered, "s")
    copy(columns, filtered.P_six)
    prior = eights(columns)
    for r in range(filtered.s):  # Lambda P
        total = a.P[r, 0] * prior[0]
        for t in range(1, filtered.s):
            total += a.P[r, t] * prior[t]
        weighed[r] = total
    moved = a.x[0] * prior[0]
    for t in range(1, filtered.s):
        moved += a.x[t] * prior[t]
    six = room(filtered, "8")
    eights(six)[0] = moved
    for s in range(6):
        x[s] = filtered.x[s] - six[s]
    for s in range(6):
        left = prior[s]
        for t in range(filtered.s):
            left -= filtered.P[s, t] * weighed[t]
        eights(six)[0] = left
        for t in range(6):
            P[s, t] = six[t]
