"""The factor graph, and eskf15, iekf and the smoother, against GTSAM: another library's integration and optimiser."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.plugin import Tilt
from jerkbench.datasets.field_v1 import FieldV1
from jerkbench.errors import PluginError, RecordingError
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.eskf15_rts import Eskf15Smoother
from jerkbench.filters.fgo import FactorGraph
from jerkbench.filters.iekf import InvariantEkf

GIVEN = {"use_heading": False, "initial_yaw_sigma_rad": 0.01, "accel_turn_on_mg": 1.0}
WHOLE_S = 100.0


@pytest.fixture(scope="module")
def gtsam():
    return pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'jerkbench[fgo]'")


def drive(duration_s):
    recording = FieldV1(duration_s=duration_s, reference_rate_hz=5.0).load(1)
    return recording, Tilt().estimate(recording)


def require_agreement(mine, oracle, sigmas, shares):
    """Position and velocity agree to so many sigmas, covariances to such a share of them."""
    np.testing.assert_array_equal(mine.index, oracle.index)
    sigma = np.sqrt(np.diagonal(oracle.covariance, axis1=1, axis2=2))
    x = [np.hstack([estimate.position_m, estimate.velocity_mps]) for estimate in (mine, oracle)]
    assert np.abs((x[0] - x[1]) / sigma).max() < sigmas
    relative = (mine.covariance - oracle.covariance) / (sigma[:, :, None] * sigma[:, None, :])
    assert np.abs(relative).max() < shares


def test_the_smoother_is_the_optimum_of_the_whole_drive(gtsam):
    recording, attitude = drive(12.0)
    smoothed = Eskf15Smoother(**GIVEN).estimate(recording, attitude, NoAdaptation())

    require_agreement(smoothed, FactorGraph(**GIVEN).estimate(recording, attitude, NoAdaptation()), 0.15, 0.1)


def test_the_filters_are_the_newest_node_of_all_that_was_before(gtsam):
    recording, attitude = drive(8.0)
    oracle = FactorGraph(lag_s=WHOLE_S, **GIVEN).estimate(recording, attitude, NoAdaptation())

    for model in (Eskf15(**GIVEN), InvariantEkf(**GIVEN)):
        require_agreement(model.estimate(recording, attitude, NoAdaptation()), oracle, 0.15, 0.1)


def test_a_lag_forgets_little(gtsam):
    recording, attitude = drive(6.0)
    whole, lagged = (
        FactorGraph(lag_s=lag_s, **GIVEN).estimate(recording, attitude, NoAdaptation()) for lag_s in (WHOLE_S, 1.0)
    )

    require_agreement(lagged, whole, 0.2, 0.2)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_loss_resists_false_fixes(gtsam, loss):
    recording, attitude = drive(12.0)
    jump = recording.position.enu_m.copy()
    jump[30::9] += [2.0, -1.0, 0.5]
    false = replace(recording, position=replace(recording.position, enu_m=jump))
    errors = []
    for chosen in ("none", loss):
        estimate = FactorGraph(loss=chosen, **GIVEN).estimate(false, attitude, NoAdaptation())
        off = np.linalg.norm(estimate.position_m - recording.reference.enu_m[estimate.index], axis=1)
        errors.append(np.sqrt(np.mean(off**2)))

    assert errors[1] < 0.2 * errors[0]


def test_an_antenna_has_its_arm(gtsam):
    recording, attitude = drive(6.0)
    arm = {"antenna_m": (0.8, -0.4, 1.5), "use_velocity": False, **GIVEN}
    smoothed = Eskf15Smoother(**arm).estimate(recording, attitude, NoAdaptation())

    require_agreement(smoothed, FactorGraph(**arm).estimate(recording, attitude, NoAdaptation()), 0.2, 0.2)


def test_without_gtsam_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "gtsam", None)
    recording, attitude = drive(4.0)
    with pytest.raises(PluginError, match=r"pip install 'jerkbench\[fgo\]'"):
        FactorGraph().estimate(recording, attitude, NoAdaptation())


def test_a_velocity_of_the_body_is_refused():
    recording, attitude = drive(4.0)
    recording = replace(recording, velocity=replace(recording.velocity, frame="body"))
    with pytest.raises(RecordingError, match="use_velocity=false"):
        FactorGraph().estimate(recording, attitude, NoAdaptation())


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"loss": "hubert"}, "Did you mean 'huber'"),
        ({"loss_scale": 0.0}, "a scale above 0"),
        ({"nonholonomic": True}, "the filter fgo has none"),
        ({"antenna_m": (1.0, 0.0, 0.0)}, "use_velocity=false only"),
    ],
)
def test_a_wrong_parameter_is_a_sentence(parameters, sentence):
    with pytest.raises(PluginError, match=sentence):
        FactorGraph(**parameters)
