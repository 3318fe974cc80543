"""S = H P H' + R = L D L' of the rows that are used, and what is divided by it."""

from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Run, room
from jerkbench.kalman import ROUNDING, SYMMETRIC

UNEQUAL = SYMMETRIC * SYMMETRIC
"""How much of S_ii S_jj the square of a difference may be."""

NAN = float("nan")


def mahalanobis(run: Run) -> float:
    """Return y' S^-1 y of the rows that are used; NaN where the run is lost.

    It is lost by an S that is not symmetric and positive definite beyond rounding.
    """
    _fill_innovation_covariance(run)
    _factorise(run)
    total = run.zero
    for r in range(6):  # y' S^-1 y = |D^-1/2 L^-1 y|^2
        rest = run.y[r]
        for j in range(r):
            rest -= run.L[r, j] * run.white[j]
        run.white[r] = rest
        total += rest * rest * run.over_D[r]
    distance: float = chosen(run.lost, 0.0, NAN, total)
    return distance


def determinant(run: Run) -> float:
    """Return det S of the rows that are used, from the factors that `mahalanobis` has found."""
    product: float = run.over_D[0]
    for r in range(1, 6):
        product *= run.over_D[r]
    return 1.0 / product


def _fill_innovation_covariance(run: Run) -> None:
    """Put H P H' + R into L; a row that is not used becomes one of the identity."""
    lost = run.lost
    for r in range(6):
        used = run.used[r]
        run.S_diagonal[r] = used * (run.P[r, r] + run.R[r, r]) + (1.0 - used)
        for c in range(r):
            both = used * run.used[c]
            run.L[r, c] = both * (run.P[r, c] + run.R[r, c])
            apart = both * (run.R[r, c] - run.R[c, r])
            lost += chosen(apart * apart, UNEQUAL * run.S_diagonal[r] * run.S_diagonal[c], 1.0, 0.0)
    run.lost = lost


def _factorise(run: Run) -> None:
    """S = L D L'. No root is drawn: one division follows the other six times, and each step waits for them."""
    for r in range(6):
        run.L[r, r] = run.S_diagonal[r]
    lost = run.lost
    for c in range(6):
        lost += chosen(run.L[c, c], ROUNDING * run.S_diagonal[c], 0.0, 1.0)
        run.over_D[c] = 1.0 / run.L[c, c]
        for r in range(5, c, -1):  # a row needs those above it before they are scaled
            factor = run.L[r, c] * run.over_D[c]
            for j in range(c + 1, r + 1):
                run.L[r, j] -= factor * run.L[j, c]
            run.L[r, c] = factor
    run.lost = lost


def solve_innovation(run: Run) -> None:
    """Make v = S^-1 y = L^-1' D^-1 L^-1 y."""
    for r in range(5, -1, -1):
        rest = run.white[r] * run.over_D[r]
        for j in range(r + 1, 6):
            rest -= run.L[j, r] * run.v[j]
        run.v[r] = rest


def solve_column(run: Run, s: int) -> None:
    """Make column ``s`` of Z = S^-1 G."""
    g = room(run, "6")
    for r in range(6):
        g[r] = run.G[r, s]
        for j in range(r):
            g[r] -= run.L[r, j] * g[j]
    for r in range(6):
        g[r] *= run.over_D[r]
    for r in range(5, -1, -1):
        for j in range(5, r, -1):
            g[r] -= run.L[j, r] * g[j]
        run.Z[r, s] = g[r]
