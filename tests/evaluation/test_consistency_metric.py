"""NEES and NIS against naive loops and the chi-square distribution."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.estimate import Estimate
from jerkbench.evaluation.metrics.consistency import Consistency
from jerkbench.recording import Imu, Recording, Reference

BURN_IN_S = 5.0


def naive_nees(estimate, recording, counted, size):
    values = []
    for k, row in enumerate(estimate.index):
        truth = np.concatenate([recording.reference.enu_m[row], recording.reference.velocity_mps[row]])[:size]
        state = np.concatenate([estimate.position_m[k], estimate.velocity_mps[k]])[:size]
        if counted[k] and np.isfinite(truth).all():
            error = state - truth
            values.append(error @ np.linalg.inv(estimate.covariance[k][:size, :size]) @ error)
    return sum(values) / len(values)


@pytest.mark.parametrize(("column", "size"), [("anees", 6), ("anees_position", 3)])
def test_anees_is_the_naive_loop(estimate, recording, counted, column, size):
    expected = naive_nees(estimate, recording, counted, size)
    assert Consistency().evaluate(estimate, recording, counted)[column] == pytest.approx(expected, rel=1e-9)


def test_errors_drawn_from_the_covariance_are_in_the_chi_square_band():
    k, rng = 4000, np.random.default_rng(3)
    root = rng.normal(size=(k, 6, 6))
    error = (root @ rng.normal(size=(k, 6, 1)))[:, :, 0]
    t_s = 0.1 * np.arange(k)
    reference = Reference(t_s, "zero", independent=True, enu_m=np.zeros((k, 3)), velocity_mps=np.zeros((k, 3)))
    recording = Recording("zero", Imu(t_s, np.zeros((k, 3)), np.zeros((k, 3))), reference)
    covariance = root @ root.transpose(0, 2, 1)
    estimate = Estimate(np.arange(k), error[:, :3], error[:, 3:], covariance, np.zeros((k, 3)))
    values = Consistency().evaluate(estimate, recording, np.ones(k, dtype=bool))
    for column, size in (("anees", 6), ("anees_position", 3)):
        low, high = chi2.ppf([1e-4, 1 - 1e-4], k * size) / k
        assert low < values[column] < high


def test_anis_is_the_naive_loop_over_the_updates_after_the_burn_in(estimate, recording, counted):
    u = estimate.updates
    terms = [nis / rows for t, nis, rows in zip(u.t_s, u.nis, u.rows, strict=True) if t >= BURN_IN_S]
    values = Consistency().evaluate(estimate, recording, counted)
    assert 0 < len(terms) < len(u.t_s)
    assert values["anis_per_row"] == pytest.approx(sum(terms) / len(terms), rel=1e-12)


def test_dropped_rows_do_not_count_as_rows(estimate, recording, counted):
    u = estimate.updates
    R_diagonal, nis_used = u.R_diagonal.copy(), u.nis_used.copy()
    whole, half = np.flatnonzero((u.rows == 6) & (u.t_s >= BURN_IN_S))[:2]
    R_diagonal[whole], nis_used[whole] = np.inf, np.nan
    R_diagonal[half, :3] = np.inf
    changed = dataclasses.replace(u, R_diagonal=R_diagonal, nis_used=nis_used)
    terms = []
    for k, t in enumerate(u.t_s):
        kept = sum(1 for value in R_diagonal[k] if math.isfinite(value))
        if t >= BURN_IN_S and kept:
            terms.append(nis_used[k] / kept)
    values = Consistency().evaluate(dataclasses.replace(estimate, updates=changed), recording, counted)
    assert values["anis_used_per_row"] == pytest.approx(sum(terms) / len(terms), rel=1e-12)


@pytest.mark.parametrize("bad", [-np.eye(6), np.full((6, 6), np.nan), np.zeros((6, 6))])
def test_a_covariance_that_is_none_gives_nan(estimate, recording, counted, bad):
    covariance = estimate.covariance.copy()
    covariance[40] = bad
    values = Consistency().evaluate(dataclasses.replace(estimate, covariance=covariance), recording, counted)
    assert math.isnan(values["anees"])
    assert math.isnan(values["anees_position"])
