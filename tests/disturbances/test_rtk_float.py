import numpy as np
import pytest

from jerkbench.disturbances.multipath import RtkFloat, RtkFloatOverconfident
from jerkbench.errors import RecordingError
from jerkbench.simulation.imu import gauss_markov

FLOAT_M2 = np.diag([0.0625, 0.0625, 0.25])


def test_inside_is_float_and_outside_is_as_before(recording):
    before, done = recording.position, RtkFloat().apply(recording, 1).position
    t_s = before.t_s
    inside = ((t_s >= 30) & (t_s < 60)) | ((t_s >= 95) & (t_s < 120))
    assert (done.enu_m[inside] != before.enu_m[inside]).all()
    np.testing.assert_array_equal(done.enu_m[~inside], before.enu_m[~inside])
    np.testing.assert_allclose(done.covariance_m2[inside], before.covariance_m2[inside] + FLOAT_M2)
    np.testing.assert_array_equal(done.covariance_m2[~inside], before.covariance_m2[~inside])
    np.testing.assert_array_equal(done.true_covariance_m2, done.covariance_m2)


def test_overconfident_has_the_same_errors_and_keeps_its_covariance(recording):
    honest, boasts = (plugin().apply(recording, 2).position for plugin in (RtkFloat, RtkFloatOverconfident))
    np.testing.assert_array_equal(honest.enu_m, boasts.enu_m)
    np.testing.assert_array_equal(honest.true_covariance_m2, boasts.true_covariance_m2)
    np.testing.assert_array_equal(boasts.covariance_m2, recording.position.covariance_m2)


def test_sigma_and_correlation_in_time_are_as_said(make):
    """Over 300 seeds, against exp(-tau/15 s)."""
    recording = make(duration_s=40.0, rate_hz=1)
    plugin = RtkFloat(windows_s=((0.0, 99.0),))
    b = np.array([plugin.apply(recording, seed).position.enu_m for seed in range(300)]) - recording.position.enu_m
    for t in (0, 20, 40):
        np.testing.assert_allclose(b[:, t].std(axis=0), [0.25, 0.25, 0.5], rtol=0.17)  # 4 standard errors
    for lag in (1, 15, 30):
        now, later = b[:, : 41 - lag], b[:, lag:]
        correlation = (now * later).mean(axis=(0, 1)) / (b**2).mean(axis=(0, 1))
        np.testing.assert_allclose(correlation, np.exp(-lag / 15), atol=0.12)
    assert abs(np.corrcoef(b[:, 20].T) - np.eye(3)).max() < 0.23


def test_the_process_is_exact_at_uneven_times():
    """Against the Cholesky factor's covariance: the linear map from the noise to b, row by row."""
    t_s = np.array([0.0, 0.5, 4.0, 4.1, 30.0])

    class Unit:
        def __init__(self, column):
            self.column = column

        def standard_normal(self, shape):
            e = np.zeros(shape)
            e[self.column] = 1.0
            return e

    A = np.column_stack([gauss_markov(t_s, 15.0, Unit(k))[:, 0] for k in range(5)])
    np.testing.assert_allclose(A @ A.T, np.exp(-np.abs(t_s[:, None] - t_s) / 15.0), atol=1e-12)


def test_moving_a_window_does_not_change_the_process(recording):
    one = RtkFloat(windows_s=((30.0, 60.0),)).apply(recording, 0).position.enu_m
    other = RtkFloat(windows_s=((50.0, 90.0),)).apply(recording, 0).position.enu_m
    both = (recording.position.t_s >= 50) & (recording.position.t_s < 60)
    np.testing.assert_array_equal(one[both], other[both])


def test_no_position_is_a_sentence(make):
    with pytest.raises(RecordingError, match="made has no position fixes"):
        RtkFloat().apply(make(position=None), 0)
