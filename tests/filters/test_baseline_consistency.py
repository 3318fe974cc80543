"""With the noise that its input really has, the baseline knows how large its errors are."""

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.kinematic import Baseline
from jerkbench.timeline import build_timeline

SIGMA_A_MPS2 = FieldWhite().accel_sigma_mps2
"""The only error of u when the attitude is the true one: white, the same on each axis, however the body is turned."""


@pytest.fixture(scope="module")
def drives():
    return [FieldWhite(duration_s=60.0).load(seed) for seed in range(6)]


def squares(recording, attitude):
    """NEES of position and velocity every 5 s from 10 s on: the errors live for some 1.5 s."""
    timeline = build_timeline(recording, attitude.estimate(recording))
    estimate = CompiledEngine().run(timeline, Baseline(accel_mps2=SIGMA_A_MPS2), NoAdaptation())
    truth = recording.reference
    rows = np.searchsorted(truth.t_s[estimate.index], np.arange(10.0, 60.1, 5.0) - 1e-6)
    true = np.hstack([truth.enu_m, truth.velocity_mps])[estimate.index[rows]]
    error = true - np.hstack([estimate.position_m, estimate.velocity_mps])[rows]
    return [e @ np.linalg.solve(P, e) for e, P in zip(error, estimate.covariance[rows], strict=True)]


def test_its_nees_lies_in_the_band_when_the_attitude_is_the_true_one(drives):
    values = np.concatenate([squares(drive, ReferenceAttitude()) for drive in drives])
    low, high = chi2.ppf([0.025, 0.975], 6 * len(values)) / len(values)

    assert len(values) == 66
    assert low < values.mean() < high


def test_what_breaks_it_otherwise_is_gravity_that_leaks_through_the_tilt(drives):
    """The tilt filter's errors last for seconds and are no noise of a sample: a small sigma_a denies them."""
    assert np.mean([squares(drive, Tilt()) for drive in drives[:2]]) > 50.0
