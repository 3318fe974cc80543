"""The factor graph, and eskf15, iekf and the smoother, against GTSAM: another library's integration and optimiser."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import PluginError, RecordingError
from jerkbench.filters.eskf15 import Eskf15, Eskf15Smoother
from jerkbench.filters.fgo import FactorGraph
from jerkbench.filters.iekf import InvariantEkf
from jerkbench.inertial.factor_graph import Graph
from jerkbench.recording import Heading

GIVEN = {"use_heading": False, "initial_yaw_sigma_rad": 0.01, "accel_turn_on_mg": 1.0}
WHOLE_S = 100.0


@pytest.fixture(scope="module")
def gtsam():
    return pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'jerkbench[fgo]'")


def drive(duration_s):
    recording = FieldWhite(duration_s=duration_s, reference_rate_hz=5.0).load(1)
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


def with_headings(recording):
    """The recording with a heading of 1 degree between any two fixes."""
    truth = recording.reference
    t_s = recording.position.t_s[2:-2] + 0.03
    yaw_rad = np.interp(t_s, truth.t_s, np.unwrap(truth.euler_rad[:, 2]))
    noise = np.random.default_rng(7).normal(0.0, 0.02, len(t_s))
    return replace(recording, heading=Heading(t_s, yaw_rad + noise, np.full(len(t_s), 0.02)))


@pytest.mark.slow
@pytest.mark.parametrize(("lag_s", "oracle"), [(0.0, Eskf15Smoother), (WHOLE_S, Eskf15)])
def test_headings_are_what_they_are_to_the_error_state_filters(gtsam, lag_s, oracle):
    recording, attitude = drive(6.0)
    unsure = {**GIVEN, "use_heading": True, "initial_yaw_sigma_rad": 0.1}
    estimates = [
        model.estimate(with_headings(recording), attitude, NoAdaptation())
        for model in (oracle(**unsure), FactorGraph(lag_s=lag_s, **unsure))
    ]

    require_agreement(*estimates, 0.25, 0.2)
    np.testing.assert_allclose(estimates[0].euler_rad[5:, 2], estimates[1].euler_rad[5:, 2], atol=2e-3)


def with_false_fixes(recording):
    jump = recording.position.enu_m.copy()
    jump[30::9] += [2.0, -1.0, 0.5]
    return replace(recording, position=replace(recording.position, enu_m=jump))


def test_switches_have_the_optimum_of_geman_and_mcclure(gtsam, monkeypatch):
    """Without s, min over s of (s r)^2 + k^2 (s - 1)^2 = k^2 r^2/(k^2 + r^2): GTSAM has that loss itself."""
    recording, attitude = drive(8.0)
    arm = {"antenna_m": (0.8, -0.4, 1.5), "use_velocity": False, "loss_scale": 3.0, **GIVEN}
    switchable = FactorGraph(loss="switchable", **arm)
    shown = switchable.estimate(with_false_fixes(recording), attitude, NoAdaptation())

    def native(graph, R):
        models = graph.gtsam.noiseModel
        return models.Robust.Create(models.mEstimator.GemanMcClure.Create(3.0), models.Gaussian.Covariance(R))

    monkeypatch.setattr(Graph, "noise", native)
    oracle = FactorGraph(loss="huber", **arm).estimate(with_false_fixes(recording), attitude, NoAdaptation())
    require_agreement(shown, oracle, 0.02, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("loss", "lag_s"), [("huber", 0.0), ("cauchy", 0.0), ("switchable", 0.0), ("switchable", 2.0)])
def test_a_loss_resists_false_fixes(gtsam, loss, lag_s):
    recording, attitude = drive(12.0)
    false = with_false_fixes(recording)
    errors = []
    for chosen in ("none", loss):
        estimate = FactorGraph(loss=chosen, lag_s=lag_s, **GIVEN).estimate(false, attitude, NoAdaptation())
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
        ({"loss_scale": 0.0}, "loss_scale is 0.0; it must be a positive number"),
        ({"nonholonomic": True}, "the filter fgo has none"),
        ({"antenna_m": (1.0, 0.0, 0.0)}, "use_velocity=false only"),
    ],
)
def test_a_wrong_parameter_is_a_sentence(parameters, sentence):
    with pytest.raises(PluginError, match=sentence):
        FactorGraph(**parameters)
