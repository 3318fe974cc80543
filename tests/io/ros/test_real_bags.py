"""The two bags of robot_localization: nobody made them for us."""

import numpy as np
import pytest

from commands import verb
from jerkbench import plugins
from jerkbench.datasets.rosbag import RosBag
from jerkbench.presets import preset


@pytest.fixture(scope="module")
def bags(shared_folder):
    folder = shared_folder / "data" / "robot_localization"
    if not folder.is_dir():
        pytest.skip("the bags of robot_localization are not in ../shared/data")
    return folder


def loaded(bags, name, file):
    return plugins.create("dataset", {**preset("dataset", name), "file": str(bags / file)}).load(0)


def test_the_husky_feels_gravity_upwards_and_turns_left_where_its_course_does(bags):
    recording = loaded(bags, "husky_bag", "test1.bag")
    assert (len(recording.imu.t_s), len(recording.position.t_s), len(recording.velocity.t_s)) == (11865, 989, 3952)
    np.testing.assert_allclose(np.median(recording.imu.accel_mps2, axis=0), [0, 0, 9.79], atol=0.25)
    assert recording.imu.t_s[-1] == pytest.approx(395.3, abs=0.1)
    assert recording.reference.empty
    position, every = recording.position, 25  # ten seconds
    t_s, step_m = position.t_s[::every], np.diff(position.enu_m[::every, :2], axis=0)
    sure = np.linalg.norm(step_m, axis=1) > 4 * np.sqrt(2 * position.covariance_m2[0, 0, 0])
    course = np.arctan2(step_m[sure, 1], step_m[sure, 0])
    turned = np.concatenate([[0], np.cumsum(np.diff(recording.imu.t_s) * recording.imu.gyro_radps[1:, 2])])
    by_gyro = np.interp(0.5 * (t_s[1:] + t_s[:-1])[sure], recording.imu.t_s, turned)
    difference = np.unwrap(course) - by_gyro
    assert np.std(difference) < 0.5  # while both turn by radians
    assert np.ptp(by_gyro) > 3
    said = RosBag(str(bags / "test1.bag")).load(0).notes[0]
    assert said.startswith(
        "The IMU has gravity on +y, but a body (forward, left, up) has it on +z: attitude and forces are"
    )
    assert not any("gravity" in note for note in loaded(bags, "husky_bag", "test1.bag").notes)


def test_of_the_xsens_bag_the_imu_that_feels_gravity_is_guessed_and_zeros_refused(bags):
    file = str(bags / "xsens.bag")
    recording = RosBag(file, position_topic="/stereo_odometer/odometry", position_frame="ned").load(0)
    assert len(recording.imu.t_s) == 13334
    assert any("/xsens/imu_data" in note and "not /my_odometry2imu/imu_data" in note for note in recording.notes)
    from jerkbench.errors import RecordingError

    given = {"position_topic": "/stereo_odometer/odometry", "imu_topic": "/my_odometry2imu/imu_data"}
    with pytest.raises(RecordingError, match=r"13333 of 13333 .*frozen"):
        RosBag(str(bags / "xsens.bag"), **given).load(0)


@pytest.mark.slow
def test_a_run_without_a_reference_ends_with_the_innovations(bags, tmp_path):
    file = f"dataset.file={bags / 'test1.bag'}"
    done = verb("run", "-m", "dataset=husky_bag", file, "filter=jerk", "workers=1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "ANIS per row, with the reported R" in done.stdout
    assert "RMSE" not in done.stdout
    assert "husky_bag has no reference: none was given for the bag, so errors are n/a" in done.stdout


def test_the_cars_odometry_agrees_with_its_imu(bags):
    """Only with NED, FRD and the odometry's own headings; with a wrong frame the innovations are 40 times larger."""
    import jerkbench as package

    dataset = {"name": "xsens_bag", "file": str(bags / "xsens.bag")}
    (row,) = package.run(dataset=dataset, filter="jerk", adaptation="none").to_dict("records")
    assert row["status"] == "ok"
    assert row["anis_per_row"] < 3
