"""Means, covariances and probabilities of mixed filters.

Each number is read of all filters before one of them is written, so that none has to wait in a place of its own.
"""

import math

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.kinematic.layout import AT, KEPT, WIDTH, M, S, X
from jerkbench.linear.mixture.arguments import Mixing
from jerkbench.linear.mixture.layout import COUNT, JOINTS, MEANS, SIXES


def combine(mixing: Mixing, into: FloatArray) -> None:
    """Put mean and covariance of position and velocity of the mixture into the array ``into``."""
    filters, weights = vectors(mixing.filters, WIDTH), vectors(mixing.weights, WIDTH)
    length = mixing.filters.shape[1] // WIDTH
    apart = scratch(SIXES, WIDTH)
    for s in range(6):
        mean = weights[0] * filters[X + s]
        for j in range(1, COUNT):
            mean += weights[j] * filters[length * j + X + s]
        into[X + s] = mean
        for j in range(COUNT):
            apart[6 * j + s] = filters[length * j + X + s] - mean
    for s in range(6):
        for t in range(s + 1):
            total = weights[0] * (filters[AT[s, t]] + apart[s] * apart[t])
            for j in range(1, COUNT):
                total += weights[j] * (filters[length * j + AT[s, t]] + apart[6 * j + s] * apart[6 * j + t])
            into[AT[s, t]] = total


def log_likelihood(distance: float, numbers: FloatArray, mu: FloatArray) -> None:
    """Put log N(y; 0, S) into ``mu`` (WIDTH,), but for what all filters have in common.

    Args:
        distance: y' S^-1 y.
        numbers: the filter, number by number; M has the reciprocals of D of S = L D L' on its diagonal.
        mu: gets it.
    """
    vectors(mu, WIDTH)[0] = distance
    for run in range(WIDTH):
        position = numbers[WIDTH * M + run] * numbers[WIDTH * (M + 7) + run] * numbers[WIDTH * (M + 14) + run]
        velocity = numbers[WIDTH * (M + 21) + run] * numbers[WIDTH * (M + 28) + run] * numbers[WIDTH * (M + 35) + run]
        mu[run] = 0.5 * (math.log(position) + math.log(velocity) - mu[run])


def weigh(mixing: Mixing) -> None:
    """Log likelihoods in mu become probabilities; the largest is taken out first, so that none underflows alone."""
    mu, weights = mixing.mu, mixing.weights
    for run in range(WIDTH):
        largest, total = mu[0, run], 0.0
        for j in range(1, COUNT):
            largest = max(largest, mu[j, run])
        for j in range(COUNT):
            mu[j, run] = weights[j, run] * math.exp(mu[j, run] - largest)
            total += mu[j, run]
        for j in range(COUNT):
            mu[j, run] /= total


def mix(mixing: Mixing, c: FloatArray) -> None:
    """Mix the states by mu and Pi in the runs in which ``c`` has used a row; the others stay as they are."""
    filters, mu, weights = vectors(mixing.filters, WIDTH), vectors(mixing.mu, WIDTH), vectors(mixing.weights, WIDTH)
    transitions, length = vectors(mixing.transitions, WIDTH), mixing.filters.shape[1] // WIDTH
    joint, mean = scratch(JOINTS, WIDTH), scratch(MEANS, WIDTH)
    used = c[KEPT]
    for r in range(1, 6):
        used += c[KEPT + r]
    for j in range(COUNT):
        total = transitions[j] * mu[0]
        for i in range(1, COUNT):
            total += transitions[COUNT * i + j] * mu[i]
        weights[j] = chosen(used, 0.0, total, weights[j])
        for i in range(COUNT):
            same = 1.0 if i == j else 0.0
            joint[COUNT * i + j] = chosen(used, 0.0, transitions[COUNT * i + j] * mu[i] / total, same)
    for s in range(S):
        for j in range(COUNT):
            mean[S * j + s] = joint[j] * filters[X + s]
            for i in range(1, COUNT):
                mean[S * j + s] += joint[COUNT * i + j] * filters[length * i + X + s]
    _mix_covariances(filters, length, joint, mean)
    for j in range(COUNT):
        for s in range(S):
            filters[length * j + X + s] = mean[S * j + s]


def _mix_covariances(filters: FloatArray, length: int, joint: FloatArray, mean: FloatArray) -> None:
    """The states are still those before the mixture."""
    mixed = scratch(COUNT, WIDTH)
    for s in range(S):
        for t in range(s + 1):
            for j in range(COUNT):
                total = joint[0] * 0.0
                for i in range(COUNT):
                    first, second = length * i + X + s, length * i + X + t
                    spread = (filters[first] - mean[S * j + s]) * (filters[second] - mean[S * j + t])
                    total += joint[COUNT * i + j] * (filters[length * i + AT[s, t]] + spread)
                mixed[j] = total
            for j in range(COUNT):
                filters[length * j + AT[s, t]] = mixed[j]
