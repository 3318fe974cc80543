import numpy as np
import pytest

from bag_maker import ROS1, START_NS, Drive, odometry
from jerkbench.inspection.facts import facts_text
from jerkbench.io.bag import open_bag
from jerkbench.io.bag_survey import survey
from jerkbench.recording import Imu, Recording, Reference, Velocity


def test_a_simulated_recording_is_described(tmp_path, typed):
    words = ("data", "inspect", "field", "--set", "duration_s=20", "--figure", "field.png")
    done = typed(*words)

    assert done.returncode == 0, done.stderr
    assert "imu          2000 rows, 100 Hz, 0.010 to 20.000 s; no gaps" in done.stdout
    assert "position      100 rows, 5 Hz" in done.stdout
    assert "gravity is felt on +z" in done.stdout
    assert (tmp_path / "field.png").stat().st_size > 10_000


def facts_of(velocity=None, **changes):
    t_s = np.arange(0, 20, 0.1)
    draw = np.random.default_rng(0)
    imu = Imu(t_s, np.repeat(draw.normal(9.81, 1, (100, 3)), 2, axis=0), np.zeros((200, 3)))
    reference = Reference(np.array([0.0]), "none", independent=False)
    return facts_text(Recording("made", imu, reference, velocity=velocity, **changes))


def test_axes_that_were_true_at_times_of_their_own_have_their_own_rates():
    t_s = np.sort(np.concatenate([np.arange(0, 19, 0.25) - 0.125, np.arange(0, 19, 0.25) - 0.275]))
    mps = np.full((len(t_s), 3), np.nan)
    up = np.isclose((t_s + 0.275) % 0.25, 0, atol=1e-6) | np.isclose((t_s + 0.275) % 0.25, 0.25, atol=1e-6)
    mps[up, 2], mps[~up, :2] = 0.0, 5.0
    facts = facts_of(Velocity(t_s, mps, np.tile(np.eye(3), (len(t_s), 1, 1))))
    assert "east and north 76 rows, 4 Hz" in facts
    assert "up 76 rows, 4 Hz" in facts
    assert "6.667" not in facts


def test_only_a_standstill_that_somebody_knows_of_is_said():
    assert "stands still" not in facts_of()
    assert "no standstill at its start is known" in facts_of()
    assert "stands still for 3.0 s" in facts_of(static_start_s=3.0)


def test_repeated_samples_and_an_absent_reference_are_said():
    assert "100 of 200 samples (50.0%) repeat all values of the one before" in facts_of()
    assert "reference none" in facts_of()


def test_what_is_no_source_is_a_sentence(tmp_path, typed):
    done = typed("data", "inspect", "gone.bag")
    assert (done.returncode, done.stderr) == (2, "jerkbench: There is no file or folder gone.bag; correct the path.\n")
    done = typed("data", "inspect", "feild")
    assert "Did you mean 'field'?" in done.stderr
    (tmp_path / "a.xyz").touch()
    done = typed("data", "inspect", "a.xyz")
    assert "give --dataset NAME" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["inspect", "field", "--figure", "a.weird"], "There is no suffix of a figure '.weird'"),
        (["convert", "field", "file/a.csv"], "jerkbench: file cannot be read or written: File exists; correct the"),
        (["convert", "field", "a.csv", "--set", "duration"], "'duration' is no parameter; give KEY=VALUE"),
        (["convert", "field", "a.csv", "--set", "durations_s=3"], "Did you mean 'duration_s'?"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(tmp_path, typed, words, said):
    (tmp_path / "file").touch()
    done = typed("data", *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert said in done.stderr


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (["a.pos", "b.bag"], "could be of rosbag or rtklib; give --dataset NAME (beijing_car, broad, comma2k19, "),
        (["a.pos", "oxts/data"], "could be of rtklib or kitti; give --dataset NAME"),
        (["a.txt"], "holds nothing, that tells its data set; give --dataset NAME (beijing_car, broad, comma2k19, "),
        (["imu0/data.csv"], "imu0/data.csv is empty"),
        (["processed_log/a"], "global_pose/frame_times"),
    ],
)
def test_a_folder_is_known_by_what_it_holds(tmp_path, typed, inside, said):
    for name in inside:
        (tmp_path / "folder" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "folder" / name).touch()
    done = typed("data", "inspect", "folder")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert said in done.stderr


def test_what_a_power_loss_leaves_says_how_to_go_on(tmp_path, typed):
    Drive(duration_s=4.0).write(tmp_path / "a.bag")
    (tmp_path / "a.bag").rename(tmp_path / "a.bag.active")
    assert "rename it so that it ends in .bag" in typed("data", "inspect", "a.bag.active").stderr


def test_times_that_are_shifted_already_are_said(tmp_path, typed):
    drive = Drive(duration_s=4.0)
    drive.write(tmp_path / "a.bag")
    given = ["imu_shift_s=-0.2", "velocity_latency_s=[0.1,0.1,0.1]"]
    said = typed("data", "inspect", "a.bag", "--dataset", "fixposition", "--set", *given).stdout
    assert "shifted already by imu_shift_s=-0.2, velocity_latency_s=(0.1, 0.1, 0.1): what is left" in said
    assert "shifted already" not in typed("data", "inspect", "a.bag", "--dataset", "fixposition").stdout


def test_a_fixpositions_bag_is_recognised(tmp_path, typed):
    Drive(duration_s=4.0).write(tmp_path / "a.bag")
    assert "like a Fixposition's: dataset=fixposition knows" in typed("data", "inspect", "a.bag").stdout


def all_nan(drive):
    for message in drive.messages("/fixposition/poiimu"):
        message.linear_acceleration.x = float("nan")
    for message in drive.messages("/fixposition/gnss1"):
        message.latitude = float("nan")
        message.position_covariance[:] = float("nan")
    for message in drive.messages("/fixposition/odometry_ecef"):
        message.pose.pose.position.x = float("nan")


def absurd(drive):
    for message in drive.messages("/fixposition/poiimu")[::2]:
        message.linear_acceleration.x = 1e300
    for message in drive.messages("/fixposition/odometry_ecef")[::3]:
        message.pose.pose.position.x = message.twist.twist.linear.x = 1e300


def one_message_each(drive):
    for rows in drive.rows.values():
        del rows[1:]


def one_stamp(drive):
    for rows in drive.rows.values():
        for row in rows:
            row[0], row[2].header.stamp = START_NS, rows[0][2].header.stamp


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (all_nan, "linear acceleration is NaN or infinite in 200 of 200 messages"),
        (absurd, "length inf"),
        (one_message_each, "1 usable messages are left"),
        (one_stamp, "199 stamps repeat the one before"),
    ],
)
@pytest.mark.parametrize("dataset", [[], ["--dataset", "fixposition"]])
def test_whatever_is_in_a_bag_can_be_described(tmp_path, typed, harm, said, dataset):
    drive = Drive(duration_s=4.0)
    harm(drive)
    drive.write(tmp_path / "a.bag")
    done = typed("data", "inspect", "a.bag", *dataset)
    assert (done.returncode, done.stderr) == (0, "")
    assert said in done.stdout


def surveyed(path):
    with open_bag(path) as bag:
        return "\n".join(survey(bag))


def test_a_bag_is_described_topic_by_topic(tmp_path, typed):
    drive = Drive(duration_s=4.0)
    for message in drive.messages("/fixposition/gnss1")[:3]:
        message.status.status = -1
    for k in range(40):  # a body that heads north, its velocity in the world, computed from its positions
        ns, quarter = START_NS + k * 10**8, (0, 0, 0.5**0.5, 0.5**0.5)
        drive.add("/world", ns, odometry(ROS1, ns, (0, k, 0), quarter, (0, 10, 0), 0.0, 0.0))
        drive.add("/body", ns, odometry(ROS1, ns, (4.5e5, 5.4e6 + k, 0), quarter, (10.5, 0, 0), 0.1 + k, 0.2))
    drive.write(tmp_path / "a.bag")
    done = typed("data", "inspect", "a.bag", "--dataset", "fixposition")
    assert done.returncode == 0, done.stderr
    said = done.stdout
    assert "/fixposition/gnss1 (sensor_msgs/msg/NavSatFix): 20 messages, 5 Hz, frame FP_A" in said
    assert "status -1: 3, 2: 17" in said
    assert "recorded 0.020 s after its stamp (0.020 to 0.020 s)" in said
    assert "ECEF, by its distance from the Earth's centre" in said
    assert ": gravity on +z" in said
    world, body = (said.split(f"/{name} (")[1].split("\n/")[0] for name in ("world", "body"))
    assert "position covariance: zero throughout" in world
    assert "a map projection such as UTM, east first: probably ENU" in body
    assert "linear covariance: sigma (0.4472, 0.4472, 0.4472) in every row: a placeholder" in body
    assert "3 of 20 rows with status -1 (no fix)" in said


def test_what_a_bag_lacks_is_an_answer(tmp_path, typed):
    drive = Drive(duration_s=2.0)
    del drive.rows["/fixposition/gnss1"]
    drive.write(tmp_path / "a.bag")
    done = typed("data", "inspect", "a.bag")
    assert done.returncode == 0, done.stderr
    assert "No recording can be made of it as it is: a.bag has no topic with GNSS fixes" in done.stdout
    (tmp_path / "b.bag").write_bytes((tmp_path / "a.bag").read_bytes()[:3000])
    done = typed("data", "inspect", "b.bag")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "`rosbag reindex`" in done.stderr


@pytest.mark.parametrize(
    ("file", "oddities"),
    [
        ("test1.bag", ["gravity on +y: give imu_axes", "a placeholder rather than an estimate"]),
        (
            "xsens.bag",
            [
                "every measurement is zero: this is no IMU",
                "probably NED",
                "99% of the stamps are later than their recording",
                "347 stamps repeat the one before, 31 go backwards",
                "a placeholder rather than an estimate",
                "zero throughout, that is, unknown",
            ],
        ),
    ],
)
def test_the_oddities_of_real_bags_are_found(shared_folder, file, oddities):
    path = shared_folder / "data" / "robot_localization" / file
    if not path.exists():
        pytest.skip("the bags of robot_localization are not in ../shared/data")
    said = surveyed(path)
    assert [oddity for oddity in oddities if oddity not in said] == []


@pytest.mark.parametrize("seed", ["-1", "1.5", "x"])
def test_a_seed_is_a_whole_number(typed, seed):
    done = typed("data", "inspect", "field", "--seed", seed)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"'{seed}' is no whole number" in done.stderr
