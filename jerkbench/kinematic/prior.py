"""The prior covariance of one run in whole matrices, for an adaptation that changes it."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import fill_by, try_fill_by
from jerkbench.compilation.methods import Method
from jerkbench.compilation.vector_ops import scratch
from jerkbench.estimation.adaptation_call import GIVEN
from jerkbench.kinematic.arguments import Model, Packed, Rules, Runs, Steps, Whole
from jerkbench.kinematic.layout import AT, SIZE, SQUARED, WIDTH, N, S, X

STATE = (("x", "float64", "n"), *((name, "float64", "(n, n)") for name in ("P", "F", "Q")))
MEASURED = tuple(argument for argument in GIVEN if argument[0] != "HPHt")
PRIOR = Method("adapt_prior", (*STATE, *MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, n)")


def advance(runs: Runs, model: Model, steps: Steps, begin: int, end: int) -> None:
    """Take the transition of each run on over steps ``begin`` to ``end`` (not included)."""
    for k in range(begin, end):
        if steps.model[k] >= 0:
            for run in range(WIDTH):
                _advance_step(runs.since[run], model, steps.model[k], min(run, model.A.shape[2] - 1))


def _advance_step(since: FloatArray, model: Model, k: int, own: int) -> None:
    """Make A of ``since`` the A of the step times A, and Q A Q A' + Q."""
    gone, gathered, AQ = scratch(SIZE, 1), scratch(SIZE, 1), scratch(SIZE, 1)
    for e in range(SIZE):
        gone[e], gathered[e] = since[e], since[SIZE + e]
    for a in range(N):
        for b in range(N):
            moved = noise = 0.0
            for c in range(N):
                moved += model.A[k, N * a + c, own] * gone[N * c + b]
                noise += model.A[k, N * a + c, own] * gathered[N * c + b]
            since[N * a + b], AQ[N * a + b] = moved, noise
    for a in range(N):
        for b in range(N):
            noise = model.Q[k, N * a + b, own]
            for c in range(N):
                noise += AQ[N * a + c] * model.A[k, N * b + c, own]
            since[SIZE + N * a + b] = noise


def adapt_prior(numbers: FloatArray, runs: Runs, run: int, packed: Packed, rules: Rules, m: int) -> bool:
    """Put the adapted prior covariance of a run into its place, where it has one; return whether nothing was raised."""
    if rules.prior[run] == 0:
        return True
    whole = whole_of(runs)
    take_whole(numbers, run, whole)
    _take_transition(runs.since[run], whole)
    well = call_prior(rules, run, whole, packed, m)
    put_covariance(numbers, run, whole.answer)
    for i in range(m):
        for j in range(m):
            packed.HPHt[m * i + j] = numbers[AT[packed.rows[i], packed.rows[j]] * WIDTH + run]
    return well


def call_prior(rules: Rules, run: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the adapted prior covariance of a run; return whether `adapt_prior` raised no error."""
    given = rules.parameters[run], whole.x, whole.P, whole.F, whole.Q, packed.y, packed.R, packed.rows
    seen = (*given, rules.memory[run], whole.answer)
    if WIDTH > 1:
        well: bool = try_fill_by(rules.prior[run], seen, (m, rules.sizes[run], S))
        return well
    fill_by(rules.prior[run], seen, (m, rules.sizes[run], S))
    return True


def whole_of(runs: Runs) -> Whole:
    """Point at the room for the state of one run."""
    room = runs.whole
    matrices = room[S : S + SQUARED], room[S + SQUARED : S + 2 * SQUARED], room[S + 2 * SQUARED : S + 3 * SQUARED]
    return Whole(room[:S], *matrices, room[S + 3 * SQUARED : S + 4 * SQUARED])


def take_whole(numbers: FloatArray, run: int, whole: Whole) -> None:
    """Fill x and P."""
    for s in range(S):
        whole.x[s] = numbers[(X + s) * WIDTH + run]
        for t in range(S):
            whole.P[S * s + t] = numbers[AT[s, t] * WIDTH + run]


def _take_transition(since: FloatArray, whole: Whole) -> None:
    """Fill F and Q, and begin anew with the identity and nothing."""
    for e in range(SQUARED):
        whole.F[e] = whole.Q[e] = 0.0
    for a in range(N):
        for b in range(N):
            for i in range(3):
                e = S * (3 * a + i) + 3 * b + i
                whole.F[e], whole.Q[e] = since[N * a + b], since[SIZE + N * a + b]
            since[N * a + b] = 1.0 if a == b else 0.0
            since[SIZE + N * a + b] = 0.0


def put_covariance(numbers: FloatArray, run: int, P: FloatArray) -> None:
    """Put P into the place of the covariance, where half of it lies."""
    for s in range(S):
        for t in range(s + 1):
            numbers[AT[s, t] * WIDTH + run] = 0.5 * (P[S * s + t] + P[S * t + s])
