"""The tape: filtered states, and what each update made of them."""

from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Run, room


def copy_state(into: Run, given: Run) -> None:
    """Copy the filtered state, from a run to a row of the tape or back."""
    for a in range(given.n):
        for b in range(given.n):
            if given.width == 1:
                into.pairs[a, b] = given.pairs[a, b]
            else:
                for p in range(6):
                    into.block[p, a, b] = given.block[p, a, b]
    for s in range(given.s):
        into.x[s] = given.x[s]


def write_update(tape: Run, run: Run) -> None:
    """Write I - K H, S^-1 and S^-1 y of the update that ``run`` has just seen.

    Column s of K' = S^-1 H P lies in Z; of a measured state whose R is the finer, it is that of S^-1 R, which is what
    is left of one (see `jerkbench.kinematic.correction`).
    """
    for r in range(6):
        for s in range(run.s):
            rest = (1.0 if r == s else 0.0) - run.Z[r, s]
            if s < 6:
                rest = chosen(run.fine[s], 0.0, run.Z[r, s], rest)
            tape.left[r, s] = rest
        tape.weighed[r] = run.v[r]
    _write_inverse(tape, run)


def _write_inverse(tape: Run, run: Run) -> None:
    """S^-1 = L^-1' D^-1 L^-1 from the factors of S; 0 where a row is not used."""
    inner = room(run, "6 6")  # L^-1
    for c in range(6):
        inner[c, c] = run.used[c]
        for r in range(c + 1, 6):
            rest = 0.0 - run.L[r, c] * inner[c, c]
            for j in range(c + 1, r):
                rest -= run.L[r, j] * inner[j, c]
            inner[r, c] = rest
    for i in range(6):
        for j in range(i + 1):
            total = inner[i, i] * run.over_D[i] * inner[i, j]
            for r in range(i + 1, 6):
                total += inner[r, i] * run.over_D[r] * inner[r, j]
            tape.inverse[i, j] = total
