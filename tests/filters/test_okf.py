import numpy as np
import pytest

from jerkbench import api
from jerkbench.errors import PluginError
from jerkbench.filters.kinematic import Baseline
from jerkbench.filters.okf import OptimisedKalmanFilter
from jerkbench.testing import check_plugin

FIELD = {"name": "field_white", "duration_s": 30.0}


def of_baseline(sigma_a, dt):
    """The numbers with which one whole step has the Q of the baseline."""
    return OptimisedKalmanFilter(0.5 * sigma_a * dt**1.5, sigma_a * dt**0.5, 1.0)


@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_the_baseline_is_one_of_its_settings(dt):
    ours, theirs = of_baseline(0.3, dt).axis_model(dt, dt), Baseline(0.3).axis_model(dt, dt)

    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_the_noise_is_a_covariance_that_grows_with_time():
    model = OptimisedKalmanFilter(0.02, 0.3, -0.6)
    Q = model.axis_model(0.01, 0.01)[2]

    np.testing.assert_allclose(Q, 0.01 * np.array([[0.02**2, -0.6 * 0.02 * 0.3], [-0.6 * 0.02 * 0.3, 0.3**2]]))
    np.testing.assert_allclose(model.axis_model(0.004, 0.01)[2] + model.axis_model(0.006, 0.01)[2], Q)
    assert np.linalg.eigvalsh(Q)[0] > 0


def test_untuned_it_is_all_but_the_baseline():
    error = {name: api.run(dataset=FIELD, filter=name, seeds=2)["position_rmse_m"] for name in ("okf", "baseline")}

    np.testing.assert_allclose(error["okf"], error["baseline"], rtol=1e-3)


def test_it_keeps_its_contract_and_refuses_what_is_no_covariance():
    check_plugin("filter", OptimisedKalmanFilter())
    for wrong in ({"correlation": 1.1}, {"position_walk_m_per_sqrt_s": -1.0}):
        with pytest.raises(PluginError, match="okf"):
            OptimisedKalmanFilter(**wrong)
