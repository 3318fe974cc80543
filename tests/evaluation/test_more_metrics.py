"""The other metrics, compared with independent computations."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from jerkbench.estimate import Updates
from jerkbench.evaluation import correlated_errors
from jerkbench.evaluation.metrics.consistency import (
    Coverage,
    Crps,
    Innovation,
    LogScore,
    crps,
)
from jerkbench.evaluation.metrics.position import OneRecording, Percentiles, PositionRmse
from jerkbench.evaluation.metrics.recovery import Lockout, OutageDrift, Recovery, fault_windows_s, step_response
from jerkbench.recording import Position


@pytest.fixture
def errors(estimate, recording, counted):
    """(row of the estimate, error) where all axes are known and count."""
    truth = recording.reference.enu_m[estimate.index]
    return [
        (k, p - q)
        for k, (p, q, c) in enumerate(zip(estimate.position_m, truth, counted, strict=True))
        if c and not np.isnan(q).any()
    ]


@pytest.mark.parametrize("k", [1, 2, 3])
def test_coverage_is_the_naive_count(estimate, recording, counted, errors, k):
    inside = [abs(e[a]) <= k * math.sqrt(estimate.covariance[row, a, a]) for row, e in errors for a in range(3)]
    got = Coverage().evaluate(estimate, recording, counted)[f"coverage_{k}_sigma_percent"]
    assert got == pytest.approx(100 * sum(inside) / len(inside))


def test_percentiles_are_those_of_the_sorted_errors(estimate, recording, counted, errors):
    norms = sorted(math.hypot(*e) for _, e in errors)
    place = 0.95 * (len(norms) - 1)
    low = int(place)
    expected = norms[low] + (place - low) * (norms[low + 1] - norms[low])
    got = Percentiles().evaluate(estimate, recording, counted)
    assert got["position_p95_m"] == pytest.approx(expected)
    assert got["position_horizontal_p50_m"] < got["position_horizontal_p99_m"] <= got["position_p99_m"]


def test_the_log_score_is_scipys_density_once_a_second(estimate, recording, counted, errors, sampled):
    assert 20 < len(sampled) < 0.6 * len(errors)
    scores = [
        -multivariate_normal(np.zeros(3), estimate.covariance[k, :3, :3]).logpdf(e) for k, e in errors if k in sampled
    ]
    got = LogScore().evaluate(estimate, recording, counted)["position_log_score"]
    assert got == pytest.approx(np.mean(scores))


def test_the_drift_is_the_growth_over_the_outages(estimate, recording, counted):
    """Outages from 10 to 14 and from 20 to 22 s, of which the reference (every 0.5 s) knows all but row 25, up."""
    t_s = recording.reference.t_s[estimate.index]
    truth = recording.reference.enu_m[estimate.index]
    drifts = []
    for begin, end in recording.outages_s:
        rows = [k for k in range(len(t_s)) if begin <= t_s[k] < end and not np.isnan(truth[k]).any() and t_s[k] >= 5.0]
        first, last = (estimate.position_m[k] - truth[k] for k in (rows[0], rows[-1]))
        drifts.append(math.dist(first, last) / (t_s[rows[-1]] - t_s[rows[0]]))
    got = OutageDrift().evaluate(estimate, recording, counted)["outage_drift_mps"]
    assert got == pytest.approx(np.mean(drifts))


def updates_of(R, t_s):
    m = len(t_s)
    full = np.full((m, 6), np.nan)
    full[:, :3] = R
    return Updates(t_s, np.full(m, 3.0), np.ones(m), np.ones(m), np.zeros((m, 6)), full)


def test_lockout_is_the_longest_streak_and_none_without_fixes(estimate, recording, counted):
    assert all(math.isnan(value) for value in Lockout().evaluate(estimate, recording, counted).values())  # no fixes
    t_s = 5.0 + np.arange(10.0)
    position = Position(t_s, np.zeros((10, 3)), np.tile(0.01 * np.eye(3), (10, 1, 1)))
    R = np.full((10, 3), 0.01)
    R[1, 0] = 0.05  # one axis is enough
    R[3:7] = np.inf
    R[7, 2] = 1.0
    R[9, 1] = 0.039  # less than twice the sigma
    recording = dataclasses.replace(recording, position=position)
    estimate = dataclasses.replace(estimate, updates=updates_of(R, t_s))
    got = Lockout().evaluate(estimate, recording, counted)
    assert got == {"inflated_percent": 60.0, "rejected_percent": 40.0, "lockout_s": 4.0}


def test_innovations_that_follow_each_other_are_seen(estimate, recording, counted):
    rng = np.random.default_rng(3)
    t_s = 5.0 + np.arange(400.0)
    white = dataclasses.replace(updates_of(1.0, t_s), innovation=rng.normal(size=(400, 6)))
    walk = dataclasses.replace(white, innovation=np.cumsum(white.innovation, axis=0))
    got = {
        name: Innovation().evaluate(dataclasses.replace(estimate, updates=one), recording, counted)
        for name, one in (("white", white), ("walk", walk))
    }
    assert abs(got["white"]["innovation_correlation"]) < 0.08
    assert got["walk"]["innovation_correlation"] > 0.9
    assert got["walk"]["innovation_white_percent"] == 0.0


def test_the_interval_of_one_recording_holds_its_rmse_where_it_is_long_enough(
    estimate, recording, counted, monkeypatch
):
    assert math.isnan(OneRecording().evaluate(estimate, recording, counted)["position_rmse_low_m"])  # 50 rows
    monkeypatch.setattr(correlated_errors, "MIN_CORRELATION_TIMES", 20)
    got = OneRecording().evaluate(estimate, recording, counted)
    rmse = PositionRmse().evaluate(estimate, recording, counted)["position_rmse_m"]
    assert got["position_rmse_low_m"] < rmse < got["position_rmse_high_m"]
    assert got["error_correlation_rows"] >= 1.0


@pytest.mark.parametrize(
    "metric",
    [
        *(Coverage(), Percentiles(), LogScore(), OneRecording(), OutageDrift()),
        *(Crps(), Recovery()),
    ],
)
def test_where_nothing_counts_there_is_no_number(metric, estimate, recording, counted):
    values = metric.evaluate(estimate, recording, np.zeros_like(counted))
    assert all(math.isnan(value) for name, value in values.items() if name != "faults_counted")


@pytest.mark.parametrize(("error", "sigma"), [(0.0, 1.0), (0.7, 0.5), (-2.0, 0.3)])
def test_the_crps_is_the_integral_of_its_definition(error, sigma):
    below = quad(lambda x: norm.cdf(x, error, sigma) ** 2, -30, 0, points=[error], limit=400)[0]
    above = quad(lambda x: (1 - norm.cdf(x, error, sigma)) ** 2, 0, 30, points=[abs(error)], limit=400)[0]
    assert crps(np.array([error]), np.array([sigma]))[0] == pytest.approx(below + above, rel=1e-6)


def test_the_crps_of_known_errors():
    np.testing.assert_array_equal(crps(np.array([-2.0, 3.0]), np.zeros(2)), [2.0, 3.0])
    errors = np.random.default_rng(1).standard_normal(40_000)
    scores = [crps(errors, np.full(40_000, sigma)).mean() for sigma in (0.7, 1.0, 1.4)]
    assert min(scores) == scores[1]


def test_an_exponential_halves_in_its_half_life_and_what_stays_never_does():
    t_s = np.arange(0.0, 40.0, 0.01)
    error = np.where(t_s < 10, 0.0, np.exp(-(t_s - 10) / 5))
    found = step_response(t_s, error, 10.0, 40.0)
    assert found.peak == pytest.approx(1.0, abs=1e-2)
    assert found.halved_s == pytest.approx(5 * math.log(2), abs=0.02)
    found = step_response(np.arange(6.0), np.array([1.0, 1.0, 5.0, 4.0, 2.9, 1.0]), 2.0, 10.0)
    assert found == (5.0, 2.0)
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


def test_an_error_that_halves_every_second_recovers_in_one_and_without_outages_nothing(estimate, recording, counted):
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
    got = Recovery().evaluate(estimate, dataclasses.replace(recording, outages_s=np.empty((0, 2))), counted)
    assert math.isnan(got["recovery_s"])
    assert got["faults_counted"] == 0


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
