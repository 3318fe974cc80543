"""False returns, and errors in silence against the law of chi-square."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench import api
from jerkbench.evaluation.metrics.consistency import SilentError
from jerkbench.recording import Imu, Origin, Position, Recording, Reference

FIX_S = 0.2


def standing(length_s, sigma_m=1.0):
    """A vehicle that stands, with measurements that are exact and do not know it."""
    t_s, fix_s = np.arange(1, int(100 * length_s)) / 100, np.arange(1, int(length_s / FIX_S)) * FIX_S
    imu = Imu(t_s, np.tile([0.0, 0.0, 9.80665], (len(t_s), 1)), np.zeros((len(t_s), 3)))
    places = np.zeros((len(fix_s), 3))
    position = Position(fix_s, places, np.tile(sigma_m**2 * np.eye(3), (len(fix_s), 1, 1)))
    truth = np.zeros((len(t_s), 3))
    reference = Reference(t_s, "it stands", independent=True, enu_m=truth, velocity_mps=truth, euler_rad=truth)
    return Recording("standing", imu, reference, position, origin=Origin(48, 11, 0), static_start_s=10.0)


def estimated(recording, **adaptation):
    chosen = adaptation or {"name": "none"}
    return api.estimate(recording, filter="baseline", adaptation=chosen, attitude={"name": "none"})


def test_a_false_return_is_an_outage_and_then_one_offset():
    false = {"name": "false_return", "windows_s": [[40.0, 50.0]], "offset_m": 100.0, "false_s": 20.0}
    recording = api.disturb(standing(120.0), false, 3)
    t_s, enu_m = recording.position.t_s, recording.position.enu_m
    wrong = (t_s >= 50.0) & (t_s < 70.0)

    assert not ((t_s >= 40) & (t_s < 50)).any()
    assert np.ptp(enu_m[wrong], axis=0) == pytest.approx([0, 0, 0])
    assert np.linalg.norm(enu_m[wrong][0]) == pytest.approx(100.0)
    assert not enu_m[~wrong].any()
    np.testing.assert_array_equal(recording.outages_s, [[40.0, 50.0]])


def silent(error_m, covariance_m2):
    six = covariance_m2[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return SilentError().summarise(
        SimpleNamespace(sampled_m=error_m, sampled_m2=six, sampled_covariance_m2=covariance_m2)
    )


def test_silent_errors_of_a_consistent_filter_are_those_of_chi_square_and_count_in_seconds():
    draw, n = np.random.default_rng(2), 200_000
    root = draw.normal(size=(3, 3))
    got = silent(draw.normal(size=(n, 3)) @ root.T, np.tile(root @ root.T, (n, 1, 1)))
    assert got["silent_error_percent"] == pytest.approx(100 * chi2.sf(9.0, 3), rel=0.03)
    error = np.zeros((60, 3))
    error[[3, 4, 10, 11, 12, 13, 40], 1] = 3.01
    got = silent(error, np.tile(np.eye(3), (60, 1, 1)))
    none = silent(error, np.full((60, 3, 3), np.nan))
    assert got == {"silent_error_percent": pytest.approx(100 * 7 / 60), "silent_error_s": 4.0}
    assert np.isnan(list(none.values())).all()
    recording = standing(30.0)
    run = estimated(recording)
    moved = dataclasses.replace(run, position_m=run.position_m + 100.0)
    assert api.evaluate(moved, recording)["silent_error_percent"] == 100.0
