"""Several kinematic filters side by side, mixed at each update; `jerkbench.filters._mixture` has the equations."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDE, vectors
from jerkbench.estimation.adaptation_call import Rule, call_adapt
from jerkbench.estimation.sums import Score, add_state, add_update
from jerkbench.inertial.compiled.expect import clear
from jerkbench.inertial.compiled.feedback import is_definite
from jerkbench.inertial.compiled.update import correct, distance, project, symmetrise
from jerkbench.linear.arguments import Kept, Models, Steps
from jerkbench.linear.layout import DX_AT, H_AT, HPHT, P_AT, SPARE_AT, STATES, STRIDE, R, S, X, Y
from jerkbench.linear.predict import predict


def run_mixture(
    steps: Steps, models: Models, rule: Rule, kept: Kept, score: Score, filters: FloatArray
) -> tuple[int, int, int]:
    """Run all steps from what ``filters`` (number of them and one more, LENGTH) holds.

    Returns the numbers of states and updates, and the step after which a covariance is not positive definite, or -1.
    """
    states = updates = 0
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            for j in range(len(models.weights)):
                predict(vectors(filters[j], WIDE), filters[j], models, j, steps, k)
        if steps.update[k] >= 0:
            healthy = update(filters, steps, models, rule, kept, score, steps.update[k], updates)
            updates += 1
            if not healthy:
                return states, updates, k
        if steps.reference[k] >= 0:
            keep_state(filters, models, kept, score, steps.reference[k], states)
            states += 1
    return states, updates, -1


def keep_state(filters: FloatArray, models: Models, kept: Kept, score: Score, reference: int, number: int) -> None:
    """Keep, and score, position and velocity of the mixture."""
    place, c = number if len(kept.x) > 1 else 0, filters[len(models.weights)]
    combine(filters, models.weights, c, 6)
    kept.reference[place] = reference
    for r in range(6):
        kept.x[place, r] = c[X + r]
        for s in range(6):
            kept.P[place, 6 * r + s] = c[P_AT + STRIDE * r + s]
    add_state(score, number, kept.x[place], kept.P[place])


def combine(filters: FloatArray, weights: FloatArray, into: FloatArray, size: int) -> None:
    """Mean and covariance of the first ``size`` states of a mixture of normal distributions."""
    for r in range(size):
        mean = 0.0
        for j in range(len(weights)):
            mean += weights[j] * filters[j, X + r]
        into[X + r] = mean
    for r in range(size):
        for s in range(size):
            total = 0.0
            for j in range(len(weights)):
                apart = (filters[j, X + r] - into[X + r]) * (filters[j, X + s] - into[X + s])
                total += weights[j] * (filters[j, P_AT + STRIDE * r + s] + apart)
            into[P_AT + STRIDE * r + s] = total


def update(
    filters: FloatArray, steps: Steps, models: Models, rule: Rule, kept: Kept, score: Score, which: int, number: int
) -> bool:
    """Adapt R by the combined prediction, update and weigh all filters, mix them; whether all are healthy."""
    seen = kept.seen[number if len(kept.seen) > 1 else 0]
    kept.which[number if len(kept.seen) > 1 else 0] = which
    c = filters[len(models.weights)]
    combine(filters, models.weights, c, 6)
    rows = _show(c, steps, rule, kept, seen, which)
    seen[0], seen[1] = rows, distance(c, kept.order, rows)
    if rows > 0:
        call_adapt(rule, rows)
    used = _use(c, rule, kept, seen, rows)
    seen[2], seen[3] = used, np.nan
    if used == 0:
        return True
    seen[3] = distance(c, kept.order, used)
    add_update(score, which, seen)
    for j in range(len(models.weights)):
        if not _correct(filters[j], c, steps, kept, models.mu, j, which, used):
            return False
    _weigh(models)
    mix(filters, models, c)
    return True


def _show(c: FloatArray, steps: Steps, rule: Rule, kept: Kept, seen: FloatArray, which: int) -> int:
    """Show the adaptation the rows that are there; return how many."""
    rows = 0
    for r in range(6):
        seen[4 + r] = seen[10 + r] = np.nan
        if np.isfinite(steps.z[which, r]):
            seen[4 + r] = c[Y + rows] = rule.y[rows] = steps.z[which, r] - c[X + r]
            rule.rows[rows] = kept.rows[rows] = r
            rows += 1
    for i in range(rows):
        for j in range(rows):
            a, b = rule.rows[i], rule.rows[j]
            rule.HPHt[rows * i + j] = c[HPHT + 6 * i + j] = c[P_AT + STRIDE * a + b]
            rule.R[rows * i + j] = steps.R[which, a, b]
            c[R + 6 * i + j] = steps.reported[which, a, b]
    return rows


def _use(c: FloatArray, rule: Rule, kept: Kept, seen: FloatArray, rows: int) -> int:
    """Keep the adapted R of the rows whose variance is finite; return how many these are."""
    used = 0
    for i in range(rows):
        variance = rule.adapted[(rows + 1) * i]
        seen[10 + kept.rows[i]] = variance
        if np.isfinite(variance):
            c[Y + used] = c[Y + i]
            kept.rows[used], rule.rows[used] = kept.rows[i], i
            used += 1
    for i in range(used):
        for j in range(used):
            a, b = rule.rows[i], rule.rows[j]
            c[R + 6 * i + j] = rule.adapted[rows * a + b]
            c[HPHT + 6 * i + j] = c[HPHT + 6 * a + b]
    return used


def _correct(
    m: FloatArray, c: FloatArray, steps: Steps, kept: Kept, mu: FloatArray, j: int, which: int, rows: int
) -> bool:
    """Update a filter with the R of ``c``, and put its log likelihood into ``mu``; whether it is healthy."""
    w = vectors(m, WIDE)
    clear(w, 0)
    for i in range(rows):
        m[H_AT + STRIDE * i + kept.rows[i]] = 1.0
        m[Y + i] = steps.z[which, kept.rows[i]] - m[X + kept.rows[i]]
        for q in range(rows):
            m[R + 6 * i + q] = c[R + 6 * i + q]
    project(w, m, rows)
    logarithm = correct(w, m, kept.order, rows) + rows * math.log(2.0 * math.pi)
    for i in range(rows):
        logarithm += math.log(abs(m[S + 7 * i]))
    mu[j] = -0.5 * logarithm
    total = 0.0
    for s in range(STATES):
        m[X + s] += m[DX_AT + s]
        total += m[X + s] * 0.0
    symmetrise(m)
    return total == 0.0 and is_definite(w, m)


def _weigh(models: Models) -> None:
    """Log likelihoods in mu become probabilities; the largest is taken out first, so that none underflows alone."""
    largest, total = models.mu[0], 0.0
    for j in range(1, len(models.mu)):
        largest = max(largest, models.mu[j])
    for j in range(len(models.mu)):
        models.mu[j] = models.weights[j] * math.exp(models.mu[j] - largest)
        total += models.mu[j]
    for j in range(len(models.mu)):
        models.mu[j] /= total


def mix(filters: FloatArray, models: Models, c: FloatArray) -> None:
    """Mix the states by mu and Pi; one mixture after the other waits in the spare part of its filter."""
    n = len(models.mu)
    for j in range(n):
        total = 0.0
        for i in range(n):
            models.joint[i] = models.transitions[i, j] * models.mu[i]
            total += models.joint[i]
        for i in range(n):
            models.joint[i] /= total
        models.weights[j] = total
        combine(filters, models.joint, c, STATES)
        _store(filters[j], c)
    for j in range(n):
        _take(filters[j])


def _store(m: FloatArray, c: FloatArray) -> None:
    for s in range(STATES):
        m[DX_AT + s] = c[X + s]
        for t in range(STATES):
            m[SPARE_AT + STRIDE * s + t] = c[P_AT + STRIDE * s + t]


def _take(m: FloatArray) -> None:
    for s in range(STATES):
        m[X + s] = m[DX_AT + s]
        for t in range(STATES):
            m[P_AT + STRIDE * s + t] = m[SPARE_AT + STRIDE * s + t]
