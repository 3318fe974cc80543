"""The update of the kernel by itself, of one run and of eight, against the gain and Joseph's form in NumPy."""

from functools import cache

import numpy as np
import pytest

from jerkbench.arrays import WIDE, FloatMatrix, FloatVector
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import aligned_zeros
from jerkbench.compilation.views import row, runs_in
from jerkbench.kinematic.arguments import RUN, type_with
from jerkbench.kinematic.correction import correct, mahalanobis, solve_gains
from jerkbench.kinematic.predict import mark_axes, mirror


def update_once(
    w: FloatVector, x: FloatMatrix, P: FloatMatrix, R: FloatMatrix, y: FloatMatrix, used: FloatMatrix, Z: FloatMatrix
) -> None:
    """Update the runs in ``w``; of R, y and the state each column is one run."""
    run = runs_in(w, RUN)
    state, covariance, gains = row(x, 0, run, "s"), row(P, 0, run, "s s"), row(Z, 0, run, "6 s")
    noise, innovation, there = row(R, 0, run, "6 6"), row(y, 0, run, "6"), row(used, 0, run, "6")
    mark_axes(run)
    for s in range(run.s):
        run.x[s] = state[s]
        for t in range(run.s):
            run.P[s, t] = covariance[s, t]
    mirror(run)
    for r in range(6):
        run.y[r], run.used[r] = innovation[r], there[r]
        for c in range(6):
            run.R[r, c] = noise[r, c]
    mahalanobis(run)
    correct(run, run.s)
    solve_gains(run)
    for s in range(run.s):
        state[s] = run.x[s]
        for t in range(run.s):
            covariance[s, t] = run.P[s, t]
        for r in range(6):
            gains[r, s] = run.Z[r, s]


@cache
def entry(states, width):
    of = type_with({}, states, width)
    return compiled_loop(update_once, f"an update of {width} runs of {states} states", {"RUN": of}), of.sizes["length"]


def covariance(rng, size):
    half = rng.normal(size=(size, 2 * size)) * 10.0 ** rng.uniform(-1.0, 1.0, size)[:, None]
    return half @ half.T


def drawn(rng, states, fine):
    """A state, with a noise of which some variances are less than those of the prior, or none is."""
    x, P, R, used = rng.normal(size=states), covariance(rng, states), covariance(rng, 6), np.ones(6)
    R *= 1.0 if fine else 1e4
    used[rng.random(6) < 0.2] = 0.0
    return x, P, R * np.outer(used, used), rng.normal(size=6) * used, used


def in_columns(runs):
    return [
        np.ascontiguousarray(np.stack([part.ravel() for part in parts], axis=1)) for parts in zip(*runs, strict=True)
    ]


def updated(w, runs, states):
    """What the kernel makes of the runs: x, P and Z of each."""
    loop, _ = entry(states, len(runs))
    x, P, R, y, used = in_columns(runs)
    Z = np.zeros((6 * states, len(runs)))
    loop(w, x, P, R, y, used, Z)
    return [(x[:, k], P[:, k].reshape(states, -1), Z[:, k].reshape(6, states)) for k in range(len(runs))]


def expected(x, P, R, y, used):
    """The same in NumPy; Z is K', less the identity of a measured state whose R is the finer."""
    rows, finer = np.flatnonzero(used), (used > 0) & (np.diag(R) < np.diag(P)[:6])
    H = np.eye(len(x))[rows]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R[np.ix_(rows, rows)])
    rest = np.eye(len(x)) - K @ H
    Z = np.zeros((6, len(x)))
    Z[rows] = K.T
    Z[finer, np.flatnonzero(finer)] -= 1.0
    return x + K @ y[rows], rest @ P @ rest.T + K @ R[np.ix_(rows, rows)] @ K.T, Z, finer


@pytest.mark.parametrize("width", [1, WIDE])
@pytest.mark.parametrize("states", [6, 9, 16, 17])
def test_an_update_is_that_of_numpy_whatever_is_measured_and_finer(states, width):
    rng, w = np.random.default_rng(0), aligned_zeros(entry(states, width)[1])
    seen = []
    for turn in range(12):  # in the same array: nothing of an update is left to the next
        runs = [drawn(rng, states, fine=turn % 3 > 0) for _ in range(width)]
        for run, (x, P, Z) in zip(runs, updated(w, runs, states), strict=True):
            wanted_x, wanted_P, wanted_Z, finer = expected(*run)
            sigma = np.sqrt(np.diag(wanted_P))
            seen.append((finer.sum(), run[-1].sum()))

            assert (np.abs(x - wanted_x) < 1e-9 * sigma * (1.0 + np.abs(run[3]).max() / sigma.min())).all()
            assert (np.abs(P - wanted_P) < 1e-9 * np.outer(sigma, sigma)).all()
            np.testing.assert_allclose(Z, wanted_Z, rtol=1e-8, atol=1e-8 * np.abs(wanted_Z).max())
    finer, used = np.transpose(seen)
    assert (finer == 0).any()
    assert ((finer > 0) & (finer < used)).any()
    assert (used < 6).any()


def test_whose_noise_is_the_finer_is_nothing_to_its_neighbours():
    rng, w = np.random.default_rng(1), aligned_zeros(entry(9, WIDE)[1])
    others, first, second = (
        [drawn(rng, 9, fine) for _ in range(k)] for k, fine in ((WIDE - 1, False), (1, False), (1, True))
    )
    beside_one, beside_other = (updated(w, [*lane, *others], 9)[1:] for lane in (first, second))

    assert expected(*second[0])[3].any()
    for one, other in zip(beside_one, beside_other, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)
