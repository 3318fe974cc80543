"""CRPS, credibility, the response to a fault and recovery of a run against independent computations."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from jerkbench.evaluation.metrics.consistency import Credibility, Crps, credibility, crps
from jerkbench.evaluation.metrics.recovery import Recovery, fault_windows_s, step_response
from jerkbench.recording import Position


@pytest.mark.parametrize(("error", "sigma"), [(0.0, 1.0), (0.7, 0.5), (-2.0, 0.3)])
def test_the_crps_is_the_integral_of_its_definition(error, sigma):
    below = quad(lambda x: norm.cdf(x, error, sigma) ** 2, -30, 0, points=[error], limit=400)[0]
    above = quad(lambda x: (1 - norm.cdf(x, error, sigma)) ** 2, 0, 30, points=[abs(error)], limit=400)[0]
    assert crps(np.array([error]), np.array([sigma]))[0] == pytest.approx(below + above, rel=1e-6)


def test_who_is_certain_is_scored_by_the_error():
    np.testing.assert_array_equal(crps(np.array([-2.0, 3.0]), np.zeros(2)), [2.0, 3.0])


def test_no_other_sigma_scores_better_than_the_true_one():
    errors = np.random.default_rng(1).standard_normal(40_000)
    scores = [crps(errors, np.full(40_000, sigma)).mean() for sigma in (0.7, 1.0, 1.4)]
    assert min(scores) == scores[1]


def test_a_covariance_ten_times_too_small_has_ten_decibels():
    nees = np.random.default_rng(2).chisquare(3, 500)
    assert credibility(10 * nees, nees)[0] == pytest.approx(10)
    assert credibility(0.1 * nees, nees)[1] == pytest.approx(-10)
    assert credibility(nees, nees)[0] == 0
    assert math.isnan(credibility(np.array([]), np.array([]))[0])


def test_an_exponential_halves_in_its_half_life():
    t_s = np.arange(0.0, 40.0, 0.01)
    error = np.where(t_s < 10, 0.0, np.exp(-(t_s - 10) / 5))
    found = step_response(t_s, error, 10.0, 40.0)
    assert found.peak == pytest.approx(1.0, abs=1e-2)
    assert found.halved_s == pytest.approx(5 * math.log(2), abs=0.02)


def test_halfway_back_is_between_the_peak_and_what_was_before():
    found = step_response(np.arange(6.0), np.array([1.0, 1.0, 5.0, 4.0, 2.9, 1.0]), 2.0, 10.0)
    assert found == (5.0, 2.0)


def test_an_error_that_stays_never_halves():
    found = step_response(np.arange(5.0), np.array([0.0, 0.0, 3.0, 3.0, 3.0]), 2.0, 10.0)
    assert math.isnan(found.halved_s)
    assert math.isnan(step_response(np.arange(5.0), np.ones(5), 7.0, 10.0).peak)


def placed(estimate, recording, error_m, covariance=None):
    """The estimate with these position errors."""
    truth = recording.reference.enu_m[estimate.index]
    full = np.broadcast_to(np.eye(6), (len(estimate.index), 6, 6)) if covariance is None else covariance
    return dataclasses.replace(estimate, position_m=truth + error_m, covariance=full)


def test_the_crps_is_the_mean_of_integrals(estimate, recording, counted, sampled):
    rows = np.array(sampled)
    error = estimate.position_m[rows] - recording.reference.enu_m[estimate.index[rows]]
    sigma = np.sqrt(np.diagonal(estimate.covariance[rows, :3, :3], axis1=1, axis2=2))
    naive = [
        quad(lambda x, e=e, s=s: (norm.cdf(x, e, s) - (x >= 0)) ** 2, -60, 60, points=[0.0, e], limit=300)[0]
        for e, s in zip(error.ravel()[:24], sigma.ravel()[:24], strict=True)
    ]
    some = np.zeros_like(counted)
    some[rows[:8]] = True
    assert Crps().evaluate(estimate, recording, some)["position_crps_m"] == pytest.approx(np.mean(naive), rel=1e-4)


@pytest.mark.parametrize(("factor", "inclination"), [(1.0, 0.0), (10.0, 10.0), (0.1, -10.0)])
def test_errors_that_are_larger_than_said_have_decibels(estimate, recording, counted, sampled, factor, inclination):
    """Covariances equal to the mean square errors of the run over a factor, row by row."""
    error = np.random.default_rng(3).normal(size=(len(estimate.index), 3))
    rows = np.zeros(len(error), dtype=bool)
    rows[sampled] = True
    covariance = np.tile(np.eye(6), (len(error), 1, 1))
    covariance[:, :3, :3] = error[rows].T @ error[rows] / rows.sum() / factor
    got = Credibility().evaluate(placed(estimate, recording, error, covariance), recording, counted)
    assert got["inclination_db"] == pytest.approx(inclination, abs=1e-9)
    assert got["non_credibility_db"] == pytest.approx(abs(inclination), abs=1e-9)


def test_an_error_that_halves_every_second_recovers_in_one(estimate, recording, counted):
    t_s = recording.reference.t_s[estimate.index]
    size = np.zeros(len(t_s))
    for begin, end in recording.outages_s:
        size = np.where(t_s >= begin, 8.0 * 2.0 ** -np.maximum(0.0, t_s - end), size)
    error = size[:, None] * np.array([1.0, 0.0, 0.0])
    everywhere = np.ones_like(counted)
    whole = dataclasses.replace(
        recording, reference=dataclasses.replace(recording.reference, enu_m=np.zeros_like(recording.reference.enu_m))
    )
    got = Recovery().evaluate(placed(estimate, whole, error), whole, everywhere)
    assert got["recovery_peak_m"] == pytest.approx(8.0)
    lengths = np.diff(recording.outages_s, axis=1)[:, 0]
    assert got["recovery_s"] == pytest.approx(np.mean(lengths) + 1.0, abs=0.51)  # from the peak at the begin


def faulty(recording, sigma, faults_s):
    """The recording with fixes at 1 Hz whose true sigma in ``faults_s`` is ``sigma`` times the reported."""
    t_s = np.arange(30.0)
    reported = np.tile(np.eye(3), (30, 1, 1))
    inside = np.any([(t_s >= begin) & (t_s < end) for begin, end in faults_s], axis=0)
    true = reported * np.where(inside, sigma**2, 1.0)[:, None, None]
    fixes = Position(t_s, np.zeros((30, 3)), reported, true)
    return dataclasses.replace(recording, position=fixes, outages_s=np.empty((0, 2)))


def test_fixes_that_are_worse_than_they_say_are_faults_until_one_is_not(recording):
    made = faulty(recording, 2.1, [(8.0, 11.0), (20.0, 22.0)])
    np.testing.assert_array_equal(fault_windows_s(made), [[8.0, 11.0], [20.0, 22.0]])
    assert len(fault_windows_s(faulty(recording, 1.9, [(8.0, 11.0)]))) == 0
    with_outage = dataclasses.replace(made, outages_s=np.array([[10.0, 14.0]]))
    np.testing.assert_array_equal(fault_windows_s(with_outage), [[8.0, 14.0], [20.0, 22.0]])
    at_the_end = faulty(recording, 3.0, [(27.0, 31.0)])
    np.testing.assert_array_equal(fault_windows_s(at_the_end), [[27.0, 29.0]])


def test_the_answer_to_faults_is_the_median_and_what_never_comes_back_is_the_slowest(estimate, recording, counted):
    t_s = recording.reference.t_s[estimate.index]
    whole = dataclasses.replace(
        recording, reference=dataclasses.replace(recording.reference, enu_m=np.zeros_like(recording.reference.enu_m))
    )
    made = faulty(whole, 5.0, [(8.0, 9.0), (14.0, 15.0), (20.0, 21.0)])
    size = np.zeros(len(t_s))
    for begin, lasts_s, peak in ((8.0, 1.0, 4.0), (14.0, 2.5, 2.0), (20.0, 99.0, 6.0)):
        size = np.where((t_s >= begin) & (t_s <= begin + lasts_s), peak, np.where(t_s > begin, 0.0, size))
    everywhere = np.ones_like(counted)
    got = Recovery().evaluate(placed(estimate, made, size[:, None] * np.array([0.0, 1.0, 0.0])), made, everywhere)
    assert got == {"recovery_s": 3.0, "recovery_peak_m": 4.0, "faults_counted": 3.0}


def test_without_an_outage_there_is_nothing_to_recover_from(estimate, recording, counted):
    got = Recovery().evaluate(estimate, dataclasses.replace(recording, outages_s=np.empty((0, 2))), counted)
    assert math.isnan(got["recovery_s"])
    assert got["faults_counted"] == 0


@pytest.mark.parametrize("metric", [Crps(), Credibility(), Recovery()])
def test_where_nothing_counts_there_is_no_score(metric, estimate, recording, counted):
    got = metric.evaluate(estimate, recording, np.zeros_like(counted))
    assert all(map(math.isnan, [value for name, value in got.items() if name != "faults_counted"]))
