import dataclasses

import numpy as np
import pytest

from jerkbench.disturbances.multipath import MultipathAllAxes
from jerkbench.disturbances.noise import HeavyTailed, NoiseSine, NoiseStep
from jerkbench.disturbances.position_errors import Outliers
from jerkbench.errors import RecordingError
from jerkbench.recording import Position, Velocity

R_P = np.array([[4.0, 3.0, 0.5], [3.0, 3.0, 0.0], [0.5, 0.0, 9.0]]) * 1e-4
R_V = np.diag([1.0, 2.0, 3.0]) * 1e-3


@pytest.fixture(scope="module")
def noisy(make):
    """6001 fixes and velocities at 50 Hz with white noise of the reported, correlated covariance."""
    t_s = np.arange(6001) / 50
    rng = np.random.default_rng(5)
    p, v = (rng.multivariate_normal(np.zeros(3), R, len(t_s)) for R in (R_P, R_V))
    position = Position(t_s, p, np.tile(R_P, (len(t_s), 1, 1)))
    return make(position=position, velocity=Velocity(t_s, v, np.tile(R_V, (len(t_s), 1, 1))))


def whitened(recording):
    """Squared Mahalanobis norm divided by 3, with the reported covariance; the mean is 1 if this is correct."""
    p, v = recording.position.enu_m, recording.velocity.mps
    return [np.einsum("mi,ij,mj->m", x, np.linalg.inv(R), x) / 3 for x, R in ((p, R_P), (v, R_V))]


def test_steps_double_sigma_and_scale_the_covariance(noisy):
    done = NoiseStep(times_s=(100.0, 50.0)).apply(noisy, 0)
    for ratio in whitened(done):
        for begin, end, factor in ((0, 50, 1), (50, 100, 2), (100, 120, 4)):
            assert ratio[begin * 50 : end * 50].mean() == pytest.approx(factor**2, rel=0.1)
    np.testing.assert_array_equal(done.position.enu_m[:2500], noisy.position.enu_m[:2500])
    four_standard_errors = 4 * np.sqrt(2 * np.outer(np.diag(4 * R_P), np.diag(4 * R_P)) / 2500)
    away = np.abs(np.cov(done.position.enu_m[2500:5000].T) - 4 * R_P)
    assert (away < four_standard_errors).all()
    np.testing.assert_array_equal(done.velocity.covariance_m2ps2, noisy.velocity.covariance_m2ps2)
    np.testing.assert_allclose(done.velocity.true_covariance_m2ps2[[0, 2500, 5000]], [R_V, 4 * R_V, 16 * R_V])
    np.testing.assert_allclose(done.position.true_covariance_m2[[2499, -1]], [R_P, 16 * R_P])
    position = dataclasses.replace(noisy.position, true_covariance_m2=5 * noisy.position.covariance_m2)
    done = NoiseStep().apply(dataclasses.replace(noisy, position=position), 0).position
    np.testing.assert_allclose(done.true_covariance_m2[-1], (5 + 15) * R_P)


def test_the_sine_starts_at_one_and_is_largest_after_half_a_period(noisy):
    done = NoiseSine(largest=5.0, period_s=60.0).apply(noisy, 0)
    k = np.sqrt(done.position.true_covariance_m2[:, 0, 0] / R_P[0, 0])
    np.testing.assert_allclose(k[[0, 750, 1500, 3000, 4500]], [1, 3, 5, 1, 5], atol=1e-9)
    t_s = noisy.position.t_s
    for ratio in whitened(done):
        for begin in (10, 25, 55, 85):
            part = (t_s >= begin) & (t_s < begin + 10)
            wanted = np.mean((3 - 2 * np.cos(2 * np.pi * t_s[part] / 60)) ** 2)
            assert ratio[part].mean() == pytest.approx(wanted, rel=0.2)


def test_a_tenth_has_ten_sigma_in_position_and_velocity_independently(noisy):
    done = HeavyTailed().apply(noisy, 0)
    hits = []
    for stream, R, name in ((done.position, R_P, "true_covariance_m2"), (done.velocity, R_V, "true_covariance_m2ps2")):
        ratio = getattr(stream, name)[:, 1, 1] / R[1, 1]
        hits.append(ratio > 50)
        np.testing.assert_allclose(ratio, np.where(hits[-1], 100, 1))
        assert hits[-1].mean() == pytest.approx(0.1, abs=0.016)
    for ratio, hit in zip(whitened(done), hits, strict=True):
        assert ratio[hit].mean() == pytest.approx(100, rel=0.15)
        assert ratio[~hit].mean() == pytest.approx(1, rel=0.06)
    assert abs(np.corrcoef(*hits)[0, 1]) < 0.06


@pytest.mark.parametrize("plugin", [NoiseStep(), NoiseSine(), HeavyTailed()])
def test_position_or_velocity_is_sufficient_and_absent_axes_stay_absent(make, plugin):
    t_s = np.arange(400) / 4
    enu_m = np.tile([0.0, np.nan, 0.0], (400, 1))
    covariance = np.tile(np.diag([1.0, np.nan, 1.0]), (400, 1, 1))
    done = plugin.apply(make(position=Position(t_s, enu_m, covariance), velocity=None), 0)
    assert np.isnan(done.position.enu_m[:, 1]).all()
    assert np.isfinite(done.position.enu_m[:, [0, 2]]).all()
    assert done.position.enu_m.any()
    assert plugin.apply(make(position=None), 0).position is None
    with pytest.raises(RecordingError, match="made has neither position nor velocity"):
        plugin.apply(make(position=None, velocity=None), 0)


def test_outliers_are_single_gross_and_random_in_direction(make):
    recording = make(duration_s=2000.0)
    done = Outliers().apply(recording, 0)
    shift = done.position.enu_m - recording.position.enu_m
    length = np.linalg.norm(shift, axis=1)
    hit = length > 0
    assert hit[recording.position.t_s >= 10].mean() == pytest.approx(0.02, abs=0.006)
    assert recording.position.t_s[hit].min() >= 10
    assert 5 <= length[hit].min() < 6
    assert 19 < length[hit].max() <= 20
    direction = shift[hit] / length[hit, None]
    np.testing.assert_allclose(direction.mean(axis=0), 0, atol=0.2)
    np.testing.assert_allclose(direction.T @ direction / hit.sum(), np.eye(3) / 3, atol=0.12)
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)
    for k in np.flatnonzero(hit)[:3]:
        growth = done.position.true_covariance_m2[k] - recording.position.covariance_m2[k]
        np.testing.assert_allclose(growth, np.outer(shift[k], shift[k]), atol=1e-9)
    assert done.velocity is recording.velocity


def test_multipath_has_independent_offsets_on_all_axes(make):
    recording = make(duration_s=150.0, rate_hz=10)
    offsets = []
    for seed in range(15):
        done = MultipathAllAxes().apply(recording, seed).position
        shift = np.round(done.enu_m - recording.position.enu_m, 9)
        distinct = np.unique(shift[shift.any(axis=1)], axis=0)
        assert len(distinct) == 10
        offsets.append(distinct)
        np.testing.assert_array_equal(done.covariance_m2, recording.position.covariance_m2)
        growth = done.true_covariance_m2 - done.covariance_m2
        np.testing.assert_allclose(growth, [np.outer(s, s) for s in shift], atol=1e-7)
    offsets = np.concatenate(offsets)
    assert 0.5 <= np.abs(offsets).min() < 0.6
    assert 1.9 < np.abs(offsets).max() <= 2.0
    assert abs(np.corrcoef(np.sign(offsets).T) - np.eye(3)).max() < 0.35
    assert abs(np.corrcoef(np.abs(offsets).T) - np.eye(3)).max() < 0.35
