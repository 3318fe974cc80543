"""The attitude filters of the package vqf: agreement with the package, closed forms, gaps, and the start."""

import numpy as np
import pytest
from moved import G, degrees_between, recording, shaken, turning

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
@pytest.mark.parametrize("trial", [1, 24])
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
