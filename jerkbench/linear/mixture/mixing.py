"""Means, covariances and probabilities of mixed filters.

Each number is read of all filters before one of them is written, so that none has to wait in a place of its own.
"""

import math

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Run, View, lane, room, row, runs_in
from jerkbench.kinematic.layout import RUN
from jerkbench.linear.mixture.arguments import Mixing


def combine(mixing: Mixing, into: Run) -> None:
    """Put mean and covariance of position and velocity of the mixture into the run ``into``."""
    weights, apart = row(mixing.weights, 0, into, "count"), room(into, "count 6")
    for s in range(6):  # sum_j c_j x_j
        mean = weights[0] * runs_in(mixing.filters[0], RUN).x[s]
        for j in range(1, into.count):
            mean += weights[j] * runs_in(mixing.filters[j], RUN).x[s]
        into.x[s] = mean
        for j in range(into.count):
            apart[j, s] = runs_in(mixing.filters[j], RUN).x[s] - mean
    for s in range(6):  # sum_j c_j (P_j + (x_j - x) (x_j - x)')
        for t in range(s + 1):
            total = weights[0] * (runs_in(mixing.filters[0], RUN).P[s, t] + apart[0, s] * apart[0, t])
            for j in range(1, into.count):
                total += weights[j] * (runs_in(mixing.filters[j], RUN).P[s, t] + apart[j, s] * apart[j, t])
            into.P[s, t] = total


def log_likelihood(run: Run, distance: float, mu: FloatArray, j: int) -> None:
    """Put log N(y; 0, S) of filter ``j`` into ``mu``, but for what all filters have in common.

    ``distance`` is y' S^-1 y; the run has the reciprocals of D of S = L D L'.
    """
    row(mu, j, run, "1")[0] = distance
    for k in range(run.width):
        alone = lane(run, k)
        position = alone.over_D[0] * alone.over_D[1] * alone.over_D[2]
        velocity = alone.over_D[3] * alone.over_D[4] * alone.over_D[5]
        mu[j, k] = 0.5 * (math.log(position) + math.log(velocity) - mu[j, k])


def weigh(mixing: Mixing) -> None:
    """Log likelihoods in mu become probabilities; the largest is taken out first, so that none underflows alone."""
    mu, weights = mixing.mu, mixing.weights
    for k in range(mu.shape[1]):
        largest, total = mu[0, k], 0.0
        for j in range(1, len(mu)):
            largest = max(largest, mu[j, k])
        for j in range(len(mu)):
            mu[j, k] = weights[j, k] * math.exp(mu[j, k] - largest)
            total += mu[j, k]
        for j in range(len(mu)):
            mu[j, k] /= total


def mix(mixing: Mixing, run: Run, rows: float) -> None:
    """Mix the states by mu and Pi in the runs that have used one of their ``rows``; the others stay as they are."""
    mu, weights = row(mixing.mu, 0, run, "count"), row(mixing.weights, 0, run, "count")
    transitions = row(mixing.transitions, 0, run, "count count")
    joint, mean = room(run, "count count"), room(run, "count s")
    for j in range(run.count):
        total = transitions[0, j] * mu[0]
        for i in range(1, run.count):
            total += transitions[i, j] * mu[i]
        weights[j] = chosen(rows, 0.0, total, weights[j])
        for i in range(run.count):
            same = 1.0 if i == j else 0.0
            joint[i, j] = chosen(rows, 0.0, transitions[i, j] * mu[i] / total, same)
    for s in range(run.s):
        for j in range(run.count):
            mean[j, s] = joint[0, j] * runs_in(mixing.filters[0], RUN).x[s]
            for i in range(1, run.count):
                mean[j, s] += joint[i, j] * runs_in(mixing.filters[i], RUN).x[s]
    _mix_covariances(mixing, run, joint, mean)
    for j in range(run.count):
        for s in range(run.s):
            runs_in(mixing.filters[j], RUN).x[s] = mean[j, s]


def _mix_covariances(mixing: Mixing, run: Run, joint: View, mean: View) -> None:
    """The states are still those before the mixture."""
    mixed = room(run, "count")
    for s in range(run.s):
        for t in range(s + 1):
            for j in range(run.count):
                total = run.zero
                for i in range(run.count):
                    own = runs_in(mixing.filters[i], RUN)
                    spread = (own.x[s] - mean[j, s]) * (own.x[t] - mean[j, t])
                    total += joint[i, j] * (own.P[s, t] + spread)
                mixed[j] = total
            for j in range(run.count):
                runs_in(mixing.filters[j], RUN).P[s, t] = mixed[j]
