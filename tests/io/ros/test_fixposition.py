import numpy as np
import pytest

from bag_maker import ROS1, ROS2, SPEED_MPS, START_NS, Drive, odometry
from commands import verb
from jerkbench import plugins
from jerkbench.datasets.rosbag import Fixposition
from jerkbench.errors import PluginError, RecordingError


def loaded(drive, folder, **options):
    (folder / "a.bag").unlink(missing_ok=True)
    return Fixposition(str(drive.write(folder / "a.bag")), **options).load(0)


FORMATS = [(ROS1, "a.bag", compression) for compression in (None, "lz4", "bz2")]
FORMATS += [(ROS2, "a", compression) for compression in (None, "file", "message")]
FORMATS += [(ROS2, "a.mcap", compression) for compression in (None, "storage")]


@pytest.mark.parametrize(("store", "name", "compression"), FORMATS)
def test_every_kind_of_bag_gives_the_same_drive(tmp_path, store, name, compression):
    path = Drive(store, duration_s=6.0).write(tmp_path / name, compression)
    recording = Fixposition(str(path)).load(0)

    moved = np.maximum(0, recording.position.t_s + 0.02 - 2.0) * SPEED_MPS  # time 0 is the first sample, at 0.02 s
    np.testing.assert_allclose(recording.position.enu_m[:, 0], moved, atol=1e-6)
    np.testing.assert_allclose(recording.position.enu_m[:, 1:], 0, atol=1e-5)  # the Earth's curvature on 4 m: 1.3e-6
    np.testing.assert_allclose(recording.reference.enu_m[-1, 0], 4.0, atol=1e-6)
    np.testing.assert_allclose(recording.reference.velocity_mps[-1], [1, 0, 0], atol=1e-5)
    np.testing.assert_allclose(recording.reference.euler_rad, 0, atol=1e-5)
    np.testing.assert_array_equal(recording.velocity.mps[-1], [1, 0, 0])
    assert recording.velocity.frame == "body"
    assert (len(recording.imu.t_s), recording.imu.t_s[0]) == (300, 0.0)


def test_the_fixes_covariance_is_north_east_up_and_the_fusion_no_independent_reference(tmp_path):
    drive = Drive(duration_s=3.0)
    covariance = loaded(drive, tmp_path).position.covariance_m2[0]
    np.testing.assert_allclose(covariance, np.diag([1e-4, 4e-4, 9e-4]))  # stated 4e-4, 1e-4, 9e-4
    other = Fixposition(str(tmp_path / "a.bag"), covariance_order="enu").load(0).position.covariance_m2[0]
    np.testing.assert_allclose(other, np.diag([4e-4, 1e-4, 9e-4]))
    recording = Fixposition(str(tmp_path / "a.bag")).load(0)
    assert not recording.reference.independent
    assert "sensor's own fusion (/fixposition/odometry_ecef)" in recording.reference.source
    assert any("Velocity and reference are of the same topic" in note for note in recording.notes)
    without = Fixposition(str(tmp_path / "a.bag"), velocity="none").load(0)
    assert without.velocity is None
    assert not without.notes


@pytest.mark.parametrize("frame", ["ECEF", "FP_ECEF", "nonsense"])
@pytest.mark.parametrize("topic", ["/fixposition/odometry", "/fixposition/odometry_ecef"])
def test_every_generation_of_the_driver(tmp_path, topic, frame):
    drive = Drive(odometry_topic=topic, duration_s=3.0)
    for message in drive.messages(topic) + drive.messages("/fixposition/poiimu"):
        message.header.frame_id = frame
    assert len(loaded(drive, tmp_path).reference.t_s) == 30


def test_the_newest_drivers_odometries_and_a_namespace_that_chooses_a_sensor(tmp_path):
    drive = Drive(duration_s=3.0)
    drive.rows = {topic.replace("/fixposition", "/robot/vrtk"): rows for topic, rows in drive.rows.items()}
    for k in range(40):
        ns = START_NS + k * 75_000_000
        drive.add("/robot/vrtk/odometry_enu", ns, odometry(ROS1, ns, (k, 0, 0), (0, 0, 0, 1)))
        drive.add("/robot/vrtk/fpa/odometry", ns, odometry(ROS1, ns, (k, 0, 0), (0, 0, 0, 1)))
    recording = loaded(drive, tmp_path)
    assert len(recording.reference.t_s) == 30
    assert "/robot/vrtk/odometry_ecef" in recording.reference.source
    drive = Drive(duration_s=3.0)
    for topic, rows in list(drive.rows.items()):
        drive.rows[topic.replace("/fixposition", "/second")] = rows[::2]
    path = str(drive.write(tmp_path / "b.bag"))
    assert len(Fixposition(path, namespace="/second").load(0).reference.t_s) == 15
    assert len(Fixposition(path, namespace="fixposition").load(0).reference.t_s) == 30


def test_before_6_1_the_positions_are_the_fusions_and_that_is_said(tmp_path):
    drive = Drive(odometry_topic="/fixposition/odometry", duration_s=3.0)
    drive.rows["/fixposition/navsatfix"] = drive.rows.pop("/fixposition/gnss1")
    recording = loaded(drive, tmp_path)
    assert len(recording.position.t_s) == 15
    assert any("older than 6.1" in note for note in recording.notes)


def test_fixes_that_were_never_stamped_get_the_time_of_recording_less_its_delay(tmp_path):
    drive = Drive(duration_s=5.0)
    true = loaded(drive, tmp_path).position
    for message in drive.messages("/fixposition/gnss1"):
        message.header.stamp.sec, message.header.stamp.nanosec = 315_964_800, 0  # 1980-01-06
    recording = loaded(drive, tmp_path)
    np.testing.assert_allclose(recording.position.t_s, true.t_s, atol=1e-9)
    (note,) = [note for note in recording.notes if "a stamp before 2000" in note]
    assert "25 of 25 rows have a stamp before 2000" in note
    assert "replaced by the time of recording less 0.020 s" in note


def test_before_the_fusion_starts_nothing_is_used(tmp_path):
    """Repeated odometry, then zeros, while the IMU goes on with a frozen gyro."""
    drive = Drive(duration_s=6.0)
    odometries, samples = drive.messages(drive.odometry_topic), drive.messages("/fixposition/poiimu")
    for message in odometries[:8]:
        message.header.stamp = odometries[0].header.stamp
    for message in odometries[8:15]:
        point, q = message.pose.pose.position, message.pose.pose.orientation
        point.x = point.y = point.z = q.x = q.y = q.z = q.w = 0.0
    for message in samples[:75]:
        message.angular_velocity = samples[0].angular_velocity
    recording = loaded(drive, tmp_path)
    assert len(recording.imu.t_s) == 300 - 75
    assert recording.imu.t_s[0] == 0.0
    assert recording.reference.t_s[1] == pytest.approx(1.6 - 76 / 50)  # the first good one, since the first sample
    said = " ".join(recording.notes)
    assert "75 of 300 rows have a frozen angular rate, the first 0.00 s into the bag: dropped" in said
    assert "7 of 60 rows have an orientation that is not a unit quaternion" in said
    assert "7 of 53 rows have the stamp of another row" in said


def test_heading_from_the_fusion(tmp_path):
    recording = loaded(Drive(duration_s=3.0), tmp_path, heading="odometry")
    np.testing.assert_allclose(recording.heading.yaw_rad, 0, atol=1e-6)  # due east
    np.testing.assert_allclose(recording.heading.sigma_rad, 0.01)
    assert recording.heading.source == "odometry"


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        ("/fixposition/odometry_ecef", "is not a Fixposition recording: no nav_msgs/Odometry ends in"),
        ("/fixposition/poiimu", "in the topic /fixposition/poiimu. Topics of the type sensor_msgs/msg/Imu: none"),
        ("/fixposition/gnss1", "has no messages in the topic /fixposition/gnss1"),
    ],
)
def test_a_missing_topic_is_a_sentence(tmp_path, gone, said):
    drive = Drive(duration_s=3.0)
    del drive.rows[gone]
    with pytest.raises(RecordingError, match=said):
        loaded(drive, tmp_path)


def test_an_odometry_that_is_not_in_ecef_is_refused(tmp_path):
    drive = Drive(duration_s=3.0)
    for k, message in enumerate(drive.messages(drive.odometry_topic)):
        message.pose.pose.position.x, message.pose.pose.position.y = float(k), 0.0
    with pytest.raises(RecordingError, match="odometry_ecef is not in ECEF"):
        loaded(drive, tmp_path)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"velocity": "wheel"}, "There is no velocity of fixposition 'wheel'"),
        ({"imu_axes": ("x", "y", "y")}, "imu_axes is .*, which is left-handed; check the signs"),
        ({"imu_axes": ("x", "y", "up")}, "give three sensor axes"),
        ({"mounting_deg": (1.0,)}, "mounting_deg has 1 entries, .*; it must have 3"),
    ],
)
def test_parameters_are_checked(options, said):
    with pytest.raises(PluginError, match=said):
        Fixposition("a.bag", **options)


def test_a_plugin_whose_fingerprint_follows_the_bytes_and_that_reads_a_single_file(tmp_path):
    path = Drive(ROS2, duration_s=2.0).write(tmp_path / "a")
    dataset = plugins.create("dataset", {"name": "fixposition", "file": str(path), "mounting_deg": [0, 0, 1]})
    before = dataset.fingerprint()
    with (path / "metadata.yaml").open("a") as file:
        file.write("\n")
    assert dataset.fingerprint() != before
    from jerkbench.testing import check_plugin

    check_plugin("dataset", Fixposition(str(Drive(duration_s=3.0).write(tmp_path / "a.bag"))))
    folder = Drive(ROS2, duration_s=3.0).write(tmp_path / "b")
    (file,) = folder.glob("*.db3")
    moved = tmp_path / "alone.db3"
    file.rename(moved)
    assert len(Fixposition(str(moved)).load(0).imu.t_s) == 150


@pytest.mark.slow
def test_a_run_says_that_the_fusion_is_no_independent_reference_and_what_was_repaired(tmp_path):
    drive = Drive(duration_s=10.0)
    drive.messages("/fixposition/poiimu")[7].linear_acceleration.x = float("nan")
    drive.write(tmp_path / "a.bag")
    words = ["dataset=fixposition", "dataset.file=a.bag", "filter=gnss_only", "figures=false", "burn_in_s=1"]
    done = verb("run", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Position RMSE (3-D) [m]" in done.stdout
    said = " ".join(done.stdout.split())
    assert "sensor's own fusion (/fixposition/odometry_ecef); not independent of the measurements" in said
    assert "Velocity and reference are of the same topic, /fixposition/odometry_ecef: they are not independent" in said
    assert "1 of 500 rows have a specific force that is NaN or infinite" in said
    table = (tmp_path / "results" / "adhoc" / "table.md").read_text()
    assert "not independent of the measurements" in table
    assert "1 of 500 rows have a specific force that is NaN or infinite" in table
