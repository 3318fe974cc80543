"""The attitude filters of the package vqf: agreement with the package, closed forms, gaps, and the start."""

import numpy as np
import pytest
from moved import G, degrees_between, pushed, recording, shaken, turning

from jerkbench.attitude.vqf import OfflineVqf, Vqf, vertical_of
from jerkbench.datasets.broad import Broad
from jerkbench.errors import RecordingError

package = pytest.importorskip("vqf")


def direct(imu, step_s, offline=False, **parameters):
    samples = imu.gyro_radps.copy(), imu.accel_mps2.copy()
    if offline:
        return vertical_of(package.offlineVQF(*samples, None, step_s, parameters)["quat6D"])
    return vertical_of(package.VQF(step_s, **parameters).updateBatch(*samples)["quat6D"])


@pytest.mark.slow
@pytest.mark.parametrize("trial", [1, 8, 16, 24, 30, 35])
def test_on_broad_it_agrees_with_the_package(trial, shared_folder):
    drive = Broad(str(shared_folder / "data" / "broad"), trial).load(0)
    step_s = drive.imu.t_s[1] - drive.imu.t_s[0]
    assert degrees_between(Vqf().verticals(drive)[0], direct(drive.imu, step_s)).max() < 1e-3
    assert degrees_between(OfflineVqf().verticals(drive)[0], direct(drive.imu, step_s, offline=True)).max() < 1e-3


def test_parameters_are_passed_to_the_package():
    drive, off = shaken(3000), {"rest_bias": False, "motion_bias": False}
    ours = Vqf(tau_acc_s=1.0, bias_forgetting_s=20.0, **off).verticals(drive)[0]
    assert Vqf(1.0, False, False, 20.0) == Vqf(tau_acc_s=1.0, bias_forgetting_s=20.0, **off)  # noqa: FBT003 - in order
    same = {"tauAcc": 1.0, "restBiasEstEnabled": False, "motionBiasEstEnabled": False, "biasForgettingTime": 20.0}
    np.testing.assert_allclose(ours, direct(drive.imu, drive.imu.nominal_interval_s, **same), atol=1e-9)
    for other in ({"tau_acc_s": 2.0}, {"tau_acc_s": 1.0, "motion_bias": True}):
        assert np.abs(ours - Vqf(**off | other).verticals(drive)[0]).max() > 1e-4
    drive = shaken(3000)
    ours = Vqf(bias_forgetting_s=2.0).verticals(drive)[0]
    np.testing.assert_allclose(ours, direct(drive.imu, drive.imu.nominal_interval_s, biasForgettingTime=2.0), atol=1e-9)
    assert np.abs(ours - Vqf().verticals(drive)[0]).max() > 1e-6


@pytest.mark.parametrize("plugin", [Vqf(), OfflineVqf(), Vqf(alignment="rest")])
def test_a_constant_rate_is_followed(plugin):
    drive, truth = turning([0.3, -0.2, 0.5])
    assert degrees_between(plugin.verticals(drive)[0], truth).max() < 0.02


def test_a_constant_acceleration_causes_a_tilt_with_the_time_constant():
    """A step through a Butterworth low-pass of second order with the cut-off sqrt(2)/(2 pi tau): a closed form."""
    tau = 3.0
    x, _ = Vqf(tau_acc_s=tau, rest_bias=False, motion_bias=False).verticals(pushed([1.0, 0.0, 0.0], 40.0, rest_s=10.0))
    after_s = np.arange(1, 3001) / 100.0
    decay = np.exp(-after_s / tau)  # its poles are at (-1 +- i)/tau
    level = 1.0 - decay * (np.cos(after_s / tau) + np.sin(after_s / tau))
    np.testing.assert_allclose(x[1000:, 0] / x[1000:, 2], level / G, atol=2e-3)
    np.testing.assert_allclose(x[-1, 0] / x[-1, 2], 1.0 / G, atol=1e-4)


def test_a_constant_acceleration_has_half_its_effect_in_the_smoother_at_its_start():
    """The same low-pass forwards and backwards has the response 1/(1 + (w/wc)^4): a step of it is a closed form."""
    tau, off = 1.0, {"rest_bias": False, "motion_bias": False}
    x, _ = OfflineVqf(tau_acc_s=tau, **off).verticals(pushed([1.0, 0.0, 0.0], 20.0, rest_s=10.0))
    share = (np.arange(2000) - 999.5) / 100.0 / tau
    away = np.exp(-np.abs(share)) * np.cos(share) / 2
    level = np.where(share > 0, 1.0 - away, away)
    np.testing.assert_allclose(x[:, 0] / x[:, 2], level / G, atol=1e-5)


def test_in_a_gap_the_rate_at_its_end_is_used():
    """One second is missing in the middle of a turn."""
    drive, truth = turning([0.0, 0.4, 0.0], seconds=10.0)
    there = np.r_[0:500, 600:1000]
    gap = recording(drive.imu.gyro_radps[there], drive.imu.accel_mps2[there], 2.0, t_s=drive.imu.t_s[there])
    assert degrees_between(Vqf(tau_acc_s=100.0).verticals(gap)[0], truth[there]).max() < 0.3
    with pytest.raises(RecordingError, match=r"moved has a gap of 1\.01 s"):
        OfflineVqf().verticals(gap)


def test_it_starts_with_the_requested_alignment():
    """In motion, gravity interprets the acceleration as tilt, and rest starts level."""
    drive = recording(np.zeros((200, 3)), np.tile([2.0, 0.0, G], (200, 1)))
    slow = {"tau_acc_s": 30.0, "rest_bias": False}
    assert degrees_between(Vqf(**slow).verticals(drive)[0][0], [0.0, 0.0, 1.0]) > 10.0
    assert degrees_between(Vqf(**slow, alignment="rest").verticals(drive)[0][0], [0.0, 0.0, 1.0]) < 0.1
