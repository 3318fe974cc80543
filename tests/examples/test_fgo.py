"""The factor graph of examples/fgo, compared with the smoother of eskf15. Both solve the same problem independently."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jerkbench import api
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.filters.eskf15 import Eskf15Smoother
from jerkbench.plugins.checks import check_plugin

pytest.importorskip("gtsam", reason="gtsam is not installed: pip install examples/fgo")
sys.path.append(str(Path(__file__).parents[2] / "examples" / "fgo"))
from gtsam_graph import GtsamGraph


@pytest.fixture(scope="module")
def recording():
    return FieldWhite(duration_s=12.0, reference_rate_hz=5.0).load(1)


def test_it_conforms_and_agrees_with_the_smoother_of_eskf15(recording):
    check_plugin("filter", GtsamGraph())
    attitude = Tilt().estimate(recording)
    given = {"use_heading": False, "initial_yaw_sigma_rad": 0.05, "gyro_bias_from_rest": False}
    oracle = Eskf15Smoother(**given).estimate(recording, attitude, NoAdaptation())
    mine = GtsamGraph().estimate(recording, attitude, NoAdaptation())
    rows = np.isin(oracle.index, mine.index)
    sigma = np.sqrt(np.diagonal(oracle.covariance, axis1=1, axis2=2))[rows]
    x = [np.hstack([own.position_m, own.velocity_mps]) for own in (mine, oracle)]
    assert rows.sum() == len(mine.index) > 40
    assert np.median(np.abs(x[0] - x[1][rows]) / sigma) < 0.2
    ratios = np.sqrt(np.diagonal(mine.covariance, axis1=1, axis2=2)) / sigma
    assert np.median(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_loss_resists_false_fixes(recording, loss):
    jump = recording.position.enu_m.copy()
    jump[30::9] += [2.0, -1.0, 0.5]
    false = replace(recording, position=replace(recording.position, enu_m=jump))
    errors = [
        api.evaluate(api.estimate(false, filter=GtsamGraph(loss=chosen)), false)["position_rmse_m"]
        for chosen in ("none", loss)
    ]

    assert errors[1] < 0.2 * errors[0]
