"""Closed loops over small matrices, and the algebra that makes an update one of the measured rows, against NumPy."""

import sys

import numpy as np
import pytest
from scipy.linalg import eigh

from jerkbench import plugins
from jerkbench.adaptation import common, linalg
from jerkbench.adaptation.common import (
    _SEEN,
    distances,
    fill_blend,
    fill_square,
    first_distance,
    gain_of,
    innovate,
    measured_of,
    settle,
    spread_part,
    stack_of,
    weighed_prior,
)
from jerkbench.adaptation.linalg import (
    diagonalise,
    explained_sums,
    factorise,
    forward_rows,
    residuals_of,
    root_of,
    solve,
    solve_rows,
    submatrix,
    update_residuals,
    weighted,
    whiten,
    whiten_both,
    whiten_rows,
)
from jerkbench.kalman import ROUNDING

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
    A, C, b, B = covariance(rng, n), covariance(rng, n), rng.normal(size=n), rng.normal(size=(n, 4))
    L = np.linalg.cholesky(A)
    M, x, X = np.empty((n, n)), np.empty(n), np.empty((n, 4))
    factorise(np.tril(A), M)
    np.testing.assert_allclose(M.diagonal(), L.diagonal() ** -2, rtol=1e-9)
    np.testing.assert_allclose(np.tril(M, -1), np.tril(L / L.diagonal(), -1), rtol=1e-9, atol=1e-12)

    solve(M, b, x)
    np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-9)
    forward_rows(M, B, X)
    np.testing.assert_allclose(X, np.linalg.solve(L / L.diagonal(), B), rtol=1e-9, atol=1e-12)
    solve_rows(M, B, X)
    np.testing.assert_allclose(X, np.linalg.solve(A, B), rtol=1e-9)

    U = root_of(np.tril(A), n)
    np.testing.assert_allclose(U, L.T, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(root_of(A, (n + 1) // 2), L.T[: (n + 1) // 2], rtol=1e-12, atol=1e-13)
    whiten(U, b, x)
    np.testing.assert_allclose(x, np.linalg.solve(L, b), rtol=1e-9)
    whiten_rows(U, B, X)
    np.testing.assert_allclose(X, np.linalg.solve(L, B), rtol=1e-9)
    white = np.empty((n, n))
    whiten_both(U, C, white)
    np.testing.assert_allclose(white, np.linalg.solve(L, np.linalg.solve(L, C).T), rtol=1e-9, atol=1e-9)
    assert np.array_equal(white, white.T)


@pytest.mark.parametrize("largest", [1.0, 1e12])
@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_both_covariances_are_diagonal_in_their_own_coordinates(rows, largest):
    """Against scipy's generalised eigenvalues, and sums of the update in whole matrices."""
    P, R, y, _H = case(rows)
    scale = np.where(np.arange(9) == 0, np.sqrt(largest), 1.0)
    N, xi, weight = submatrix(P * scale * scale[:, None], rows), 0.7, 1.6
    m = len(rows)
    d, w, X = np.empty(m), np.empty(m), np.column_stack([N, y])
    diagonalise(N.copy(), R.copy(), d, X)
    np.testing.assert_allclose(np.sort(d), eigh(N, R, eigvals_only=True), rtol=1e-9 * np.sqrt(largest))

    explained, prior, measured = explained_sums(d, X[:, m], xi / weight, w)
    S = N / xi + R / weight
    v = np.linalg.solve(S, y)
    assert explained == pytest.approx(np.trace(np.linalg.solve(S, N)) / xi, rel=1e-9)
    assert prior == pytest.approx(v @ N @ v / xi**2, rel=1e-7)
    assert measured == pytest.approx(v @ R @ v / xi**2, rel=1e-7)
    np.testing.assert_allclose(X[:, :m].T @ w, N @ v / xi, rtol=1e-7)


@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_residuals_are_those_after_an_update_with_the_weighed_covariance(rows):
    P, R, y, _H = case(rows)
    N, L = submatrix(P, rows), np.linalg.cholesky(R)
    of = residuals_of(y, N, R)
    of.D[:] = 1.0 / np.linspace(0.1, 0.9, len(rows))
    update_residuals(of)
    LDLt = L @ np.diag(of.D) @ L.T
    np.testing.assert_allclose(weighted(of.U, of.D), LDLt, rtol=1e-10, atol=1e-11)
    after = y - N @ np.linalg.solve(N + LDLt, y)
    np.testing.assert_allclose(of.e, np.linalg.solve(L, after), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan])
def test_a_matrix_without_a_root_is_refused(bad):
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        factorise(np.diag([1.0, bad]), np.zeros((2, 2)))
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        root_of(np.diag([1.0, bad]), 2)


@pytest.mark.parametrize("below", [0.0, 1e-11, 1e-4])
def test_what_rounding_takes_below_zero_has_factors(below):
    """As an engine takes it: after 100 s in one step every form of the update has errors of 1e-11 there."""
    A, M = np.array([[4.0, 2.0], [2.0, 1.0 - below]]), np.empty((2, 2))
    factorise(A, M)
    assert M[0, 0] == pytest.approx(0.25)
    assert M[1, 1] == pytest.approx(1.0 / (ROUNDING * (1.0 - below)), rel=1e-9)
    assert root_of(A, 2)[1, 1] == pytest.approx(np.sqrt(ROUNDING * (1.0 - below)), rel=1e-9)


@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_a_pass_with_weights_is_the_update_with_the_weighed_covariances(rows):
    P, R, y, H = case(rows)
    stack = stack_of(P, R, rows, y)
    p, m = _SEEN, len(rows)
    stack.inverses[0] = 1.0 / np.linspace(0.1, 0.9, p + m)
    settle(stack, np.ones(9))

    Bp, Br = np.linalg.cholesky(P), np.linalg.cholesky(R)
    Pw = Bp @ np.diag(np.append(stack.inverses[0, :p], np.ones(9 - p))) @ Bp.T
    Rw = Br @ np.diag(stack.inverses[0, p:]) @ Br.T
    K = Pw @ H.T @ np.linalg.inv(H @ Pw @ H.T + Rw)
    np.testing.assert_allclose(weighed_prior(P, stack.Up, stack.inverses), Pw, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(weighted(Br.T[None], stack.inverses[0, p:]), Rw, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(gain_of(stack), K, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(stack.steps[0], K @ y, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(stack.residual[0, p:], np.linalg.solve(Br, y - H @ K @ y), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(
        np.append(stack.residual[0, :p], np.zeros(9 - p)), np.linalg.solve(Bp, K @ y), rtol=1e-9, atol=1e-11
    )


@pytest.mark.parametrize("n", [6, 9])
@pytest.mark.parametrize(
    "name", ["huber", "maximum_correntropy", "maximum_correntropy_r", "cerkf_r", "ssmkf", "ssmkf_r"]
)
def test_axes_apart_are_gone_over_one_by_one_with_the_same_result(monkeypatch, name, n):
    rng, rule, rows = np.random.default_rng(n), plugins.create("adaptation", {"name": name}), np.arange(6)
    of_one_axis = np.arange(n) % 3 == np.arange(n)[:, None] % 3
    P, y = covariance(rng, n) * of_one_axis, 9.0 * rng.normal(size=6)
    R = covariance(rng, 6) * of_one_axis[:6, :6]

    def answers():
        memory = np.zeros(6)
        given = P, np.eye(n), 0.0 * P, y, R, rows, memory
        prior = rule.adapt_prior(np.ones(n), *given) if hasattr(rule, "adapt_prior") else P
        gain = rule.adapt_gain(np.ones(n), P, y, R, rows, memory) if hasattr(rule, "adapt_gain") else 0.0
        return prior, rule.adapt(y, prior[:6, :6], R, rows, memory), gain

    whole = answers()
    for module in (linalg, common, sys.modules[type(rule).__module__]):
        monkeypatch.setattr(module, "AXES", 3, raising=False)
    for one, other in zip(answers(), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("rows", ROWS, ids=str)
def test_two_passes_over_the_measured_rows_are_those_over_all_states(rows):
    """E of all nine states, mixed as Student's t mixes it."""
    P, R, y, H = case(rows)
    part, N, share, E, xi, weight = measured_of(P, R, rows), submatrix(P, rows), 1.0, P, 0.7, 0.4
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
        fill_blend(part.W, N, 5.0, part.D, following)
        share, xi = (5.0 + following * share / xi) / 6.0, following
        np.testing.assert_allclose(spread_part(P, rows, N, part.W, share), E, rtol=1e-8, atol=1e-9)
