"""The inertial navigation with the wheel of a real car, twenty seconds without GNSS."""

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.comma2k19 import Comma2k19
from jerkbench.disturbances.outages import GnssOutage
from jerkbench.filters.eskf15 import Eskf15

TRUE_SCALE = 1.0 / 1.0087 - 1.0
"""Of the speed on the car's bus, fitted on the reference."""


@pytest.fixture(scope="module")
def car(shared_folder):
    """The speed as the bus has it, without the correction that is known of it."""
    recording = Comma2k19(str(shared_folder / "data" / "comma2k19"), wheel_scale=1.0).load(0)
    recording = GnssOutage(windows_s=((20.0, 40.0),)).apply(recording, 0)
    return recording, Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def solve(car, *, wheel_scale):
    recording, attitude = car
    model = Eskf15(6.0, 1.8, nonholonomic=True, wheel_scale=wheel_scale)
    solution = model.solve(recording, attitude, NoAdaptation())
    estimate, truth = solution.estimate, recording.reference
    t_s = truth.t_s[estimate.index]
    level = np.linalg.norm((estimate.position_m - truth.enu_m[estimate.index])[:, :2], axis=1)
    return solution, np.sqrt(np.mean(level[(t_s >= 20.0) & (t_s < 40.0)] ** 2))


@pytest.mark.slow
def test_the_scale_that_was_fitted_on_the_reference_is_found_without_it(car):
    (solution, found_m), (_, trusted_m) = solve(car, wheel_scale=True), solve(car, wheel_scale=False)
    sigma = np.sqrt(solution.covariance[15, 15])

    assert sigma < 1e-3
    assert solution.state.wheel_scale == pytest.approx(TRUE_SCALE, abs=3 * sigma)
    assert found_m < 0.5  # the reference is right to decimetres
    assert trusted_m > 4 * found_m
