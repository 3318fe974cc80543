import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import RecordingError
from jerkbench.recording import Imu, Recording, Reference
from synthetic import recording_at_rest


def test_on_the_field_it_is_the_truth_and_returns_the_true_acceleration():
    drive = FieldWhite(duration_s=30.0, noise=False).load(0)
    attitude = plugins.create("attitude", {"name": "reference"}).estimate(drive)
    np.testing.assert_array_equal(attitude.euler_rad, drive.reference.euler_rad)
    u = np.diff(drive.reference.velocity_mps, axis=0) / 0.01
    np.testing.assert_allclose(attitude.accel_enu_mps2[1:], u, atol=1e-9)
    assert not attitude.triggered.any()


def made(t_s, euler, imu_t_s=(0.0, 0.05, 0.1, 0.15)):
    n = len(imu_t_s)
    imu = Imu(imu_t_s, np.tile([0.0, 0.0, 9.81], (n, 1)), np.zeros((n, 3)))
    return Recording("farm", imu, Reference(t_s, "made up", independent=True, euler_rad=euler))


def test_the_nearest_stamp_is_taken_and_rows_with_a_nan_are_passed_over():
    euler = np.array([[0.1, 0, 0], [0.2, np.nan, 0], [0.3, 0, 0]])
    attitude = ReferenceAttitude().estimate(made([0.0, 0.06, 0.12], euler))
    np.testing.assert_array_equal(attitude.euler_rad[:, 0], [0.1, 0.1, 0.3, 0.3])


@pytest.mark.parametrize("stamp_s", [0.2, -0.1])
def test_one_stamp_serves_all_that_are_near_enough(stamp_s):
    attitude = ReferenceAttitude(gap_s=0.3).estimate(made([stamp_s], np.zeros((1, 3))))
    assert attitude.euler_rad[:, 0].tolist() == [0.0] * 4


def test_endpoint_and_midpoint():
    euler = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    drive = made([0.0, 0.1], euler, (0.0, 0.1))
    end, middle = (
        ReferenceAttitude(compensation=c).estimate(drive).accel_enu_mps2[1] for c in ("endpoint", "midpoint")
    )
    np.testing.assert_allclose(end, [0, -9.81 * np.sin(1), 9.81 * (np.cos(1) - 1)], atol=1e-12)
    np.testing.assert_allclose(middle, end / 2, atol=1e-12)


def test_no_attitude_and_a_gap_are_sentences():
    with pytest.raises(RecordingError, match="without attitude"):
        ReferenceAttitude().estimate(recording_at_rest(1.0))
    nowhere = made([0.0], np.full((1, 3), np.nan))
    with pytest.raises(RecordingError, match="farm has a reference without attitude"):
        ReferenceAttitude().estimate(nowhere)
    with pytest.raises(RecordingError, match="gap_s"):
        ReferenceAttitude().estimate(made([0.0], np.zeros((1, 3))))


def test_what_the_reference_lacks_is_said_before_a_sweep_begins():
    ReferenceAttitude().require(lambda: FieldWhite(duration_s=5.0).load(0))
    with pytest.raises(RecordingError, match="rest has a reference without attitude"):
        ReferenceAttitude().require(lambda: recording_at_rest(1.0))
    with pytest.raises(RecordingError, match="raise gap_s"):
        ReferenceAttitude().require(lambda: made([0.0], np.zeros((1, 3))))
