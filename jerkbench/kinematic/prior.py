"""The prior covariance of one run in whole matrices, for an adaptation that changes it."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.calls import fill_by, try_fill_by
from jerkbench.compilation.methods import Method
from jerkbench.compilation.views import Run, lane, room
from jerkbench.estimation.adaptation_call import GIVEN
from jerkbench.kinematic.arguments import Model, Packed, Rules, Runs, Steps, Whole

STATE = (("x", "float64", "n"), *((name, "float64", "(n, n)") for name in ("P", "F", "Q")))
MEASURED = tuple(argument for argument in GIVEN if argument[0] != "HPHt")
PRIOR = Method("adapt_prior", (*STATE, *MEASURED), ("m", "size", "n"), (("m", 6), ("n", 9)), "(n, n)")


def advance(run: Run, runs: Runs, model: Model, steps: Steps, begin: int, end: int) -> None:
    """Take the transition of each run on over steps ``begin`` to ``end`` (not included)."""
    for step in range(begin, end):
        if steps.model[step] >= 0:
            for k in range(run.width):
                _advance_step(lane(run, k), runs.since[k], model, steps.model[step], min(k, model.A.shape[2] - 1))


def _advance_step(alone: Run, since: FloatArray, model: Model, k: int, own: int) -> None:
    """Make A of ``since`` the A of the step times A, and Q A Q A' + Q."""
    gone, gathered, AQ, n = room(alone, "n n"), room(alone, "n n"), room(alone, "n n"), alone.n
    for a in range(n):
        for b in range(n):
            gone[a, b], gathered[a, b] = since[n * a + b], since[n * n + n * a + b]
    for a in range(n):
        for b in range(n):
            moved = noise = 0.0
            for c in range(n):
                moved += model.A[k, n * a + c, own] * gone[c, b]
                noise += model.A[k, n * a + c, own] * gathered[c, b]
            since[n * a + b], AQ[a, b] = moved, noise
    for a in range(n):
        for b in range(n):
            noise = model.Q[k, n * a + b, own]
            for c in range(n):
                noise += AQ[a, c] * model.A[k, n * b + c, own]
            since[n * n + n * a + b] = noise


def adapt_prior(alone: Run, runs: Runs, k: int, packed: Packed, rules: Rules, m: int) -> bool:
    """Put the adapted prior covariance of run ``k`` into its place, if it has one; return whether it raised nothing."""
    if rules.prior[k] == 0:
        return True
    whole = whole_of(alone, runs)
    take_whole(alone, whole)
    _take_transition(alone, runs.since[k], whole)
    well = call_prior(alone, rules, k, whole, packed, m)
    put_covariance(alone, whole.answer)
    for i in range(m):
        for j in range(m):
            packed.HPHt[m * i + j] = alone.P[packed.rows[i], packed.rows[j]]
    return well


def call_prior(alone: Run, rules: Rules, k: int, whole: Whole, packed: Packed, m: int) -> bool:
    """Fill the adapted prior covariance of a run; return whether `adapt_prior` raised no error."""
    given = rules.parameters[k], whole.x, whole.P, whole.F, whole.Q, packed.y, packed.R, packed.rows
    seen = (*given, rules.memory[k], whole.answer)
    if len(rules.adapt) > 1:
        well: bool = try_fill_by(rules.prior[k], seen, (m, rules.sizes[k], alone.s))
        return well
    fill_by(rules.prior[k], seen, (m, rules.sizes[k], alone.s))
    return True


def whole_of(alone: Run, runs: Runs) -> Whole:
    """Point at the room for the state of one run."""
    own, s = runs.whole, alone.s
    P, F, Q, answer = s, s + s * s, s + 2 * s * s, s + 3 * s * s
    return Whole(own[:s], own[P:F], own[F:Q], own[Q:answer], own[answer : answer + s * s])


def take_whole(alone: Run, whole: Whole) -> None:
    """Fill x and P."""
    for s in range(alone.s):
        whole.x[s] = alone.x[s]
        for t in range(alone.s):
            whole.P[alone.s * s + t] = alone.P[s, t]


def _take_transition(alone: Run, since: FloatArray, whole: Whole) -> None:
    """Fill F and Q, and begin anew with the identity and nothing."""
    n = alone.n
    for e in range(alone.s * alone.s):
        whole.F[e] = whole.Q[e] = 0.0
    for a in range(n):
        for b in range(n):
            for i in range(3):
                e = alone.s * (3 * a + i) + 3 * b + i
                whole.F[e], whole.Q[e] = since[n * a + b], since[n * n + n * a + b]
            since[n * a + b] = 1.0 if a == b else 0.0
            since[n * n + n * a + b] = 0.0


def put_covariance(alone: Run, P: FloatArray) -> None:
    """Put P into the place of the covariance, where half of it lies."""
    for s in range(alone.s):
        for t in range(s + 1):
            alone.P[s, t] = 0.5 * (P[alone.s * s + t] + P[alone.s * t + s])
