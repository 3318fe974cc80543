"""Closed loops over small matrices, and the algebra that makes an update one of the measured rows, against NumPy."""

import numpy as np
import pytest

from jerkbench.adaptation._measured import distances, fill_square, first_distance, innovate, measured_of, mix, spread
from jerkbench.adaptation._small import factorise, part_of, root_of, solve, solve_rows, whiten_rows
from jerkbench.adaptation._stack import doubtable, gain_of, settle, stack_of, weighed, weighed_prior

ROWS = [np.arange(6), np.array([1]), np.array([0, 2, 4]), np.array([3, 4, 5])]


def covariance(rng, n):
    half = rng.normal(size=(n, 2 * n))
    return half @ half.T


def case(rows, n=9):
    rng = np.random.default_rng(len(rows))
    return covariance(rng, n), covariance(rng, len(rows)), 5.0 * rng.normal(size=len(rows)), np.eye(n)[rows]


@pytest.mark.parametrize("n", [1, 3, 6, 9])
def test_factors_and_solutions_are_those_of_lapack(n):
    rng = np.random.default_rng(n)
    A, b, B = covariance(rng, n), rng.normal(size=n), rng.normal(size=(n, 4))
    L, x, X, Y = root_of(A), np.empty(n), np.empty((n, 4)), np.empty((n, 4))
    solve(L, b, x)
    whiten_rows(L, B, X)
    solve_rows(L, B, Y)

    np.testing.assert_allclose(L, np.linalg.cholesky(A), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-9)
    np.testing.assert_allclose(X, np.linalg.solve(np.linalg.cholesky(A), B), rtol=1e-9)
    np.testing.assert_allclose(Y, np.linalg.solve(A, B), rtol=1e-9)


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan])
def test_a_matrix_without_a_root_is_refused(bad):
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        factorise(np.diag([1.0, bad]), np.zeros((2, 2)))


@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_a_pass_with_weights_is_the_update_with_the_weighed_covariances(rows):
    P, R, y, H = case(rows)
    stack = stack_of(P, R, rows)
    p, m = doubtable(stack), len(rows)
    stack.weights[:] = np.linspace(0.1, 0.9, p + m)
    settle(stack, np.ones(9), y)

    Bp, Br = np.linalg.cholesky(P), np.linalg.cholesky(R)
    Pw = Bp @ np.diag(1.0 / np.append(stack.weights[:p], np.ones(9 - p))) @ Bp.T
    Rw = Br @ np.diag(1.0 / stack.weights[p:]) @ Br.T
    K = Pw @ H.T @ np.linalg.inv(H @ Pw @ H.T + Rw)
    np.testing.assert_allclose(weighed_prior(P, stack), Pw, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(weighed(Br, stack.weights[p:]), Rw, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(gain_of(stack), K, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(stack.steps[0], K @ y, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(stack.residual[p:], np.linalg.solve(Br, y - H @ K @ y), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(
        np.append(stack.residual[:p], np.zeros(9 - p)), np.linalg.solve(Bp, K @ y), rtol=1e-9, atol=1e-11
    )


@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_two_passes_over_the_measured_rows_are_those_over_all_states(rows):
    """E of all nine states, mixed as Student's t mixes it."""
    P, R, y, H = case(rows)
    part, N, share, E, xi, weight = measured_of(P, R, rows), part_of(P, rows), 1.0, P, 0.7, 0.4
    assert first_distance(part, y) == pytest.approx(np.trace((N + np.outer(y, y)) @ np.linalg.inv(R)))
    for following in (0.6, 1.3):
        innovate(part, y, xi, weight)
        fill_square(part, xi)
        got = distances(part, 9, xi, weight)

        K = E / xi @ H.T @ np.linalg.inv(H @ E / xi @ H.T + R / weight)
        d, posterior = K @ y, (np.eye(9) - K @ H) @ E / xi
        D_x, e = posterior + np.outer(d, d), y - H @ d
        D_z = H @ posterior @ H.T + np.outer(e, e)
        assert got == pytest.approx((np.trace(D_x @ np.linalg.inv(E)), np.trace(D_z @ np.linalg.inv(R))))
        np.testing.assert_allclose(part.D, H @ D_x @ H.T, rtol=1e-8, atol=1e-9)

        E = (5.0 * P + following * D_x) / 6.0
        mix(part.W, N, 5.0, part.D, following)
        share, xi = (5.0 + following * share / xi) / 6.0, following
        np.testing.assert_allclose(spread(P, rows, part.W, share), E, rtol=1e-8, atol=1e-9)
