"""`data inspect` and `data cache`."""

import numpy as np
import pytest

from bag_maker import ROS1, START_NS, Drive, odometry
from jerkbench.datasets.rosbag import Fixposition, RosBag
from jerkbench.errors import RecordingError
from jerkbench.inspection.facts import facts_text
from jerkbench.io import bag
from jerkbench.recording import Imu, Recording, Reference, Velocity


def test_a_simulated_recording_is_described(tmp_path, typed):
    words = ("data", "inspect", "field", "--set", "duration_s=20", "--figure", "field.png")
    done = typed(*words)

    assert done.returncode == 0, done.stderr
    assert "imu          2000 rows, 100 Hz, 0.010 to 20.000 s; no gaps" in done.stdout
    assert "position      100 rows, 5 Hz" in done.stdout
    assert "gravity is on +z" in done.stdout
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


def test_a_known_standstill_repeated_samples_and_an_absent_reference_are_said():
    assert "stationary for" not in facts_of()
    assert "no stationary time at the start is known" in facts_of()
    assert "stationary for 3.0 s at the start" in facts_of(static_start_s=3.0)
    assert "100 of 200 samples (50.0%) repeat all values of the previous sample" in facts_of()
    assert "reference none" in facts_of()


def test_what_is_no_source_is_a_sentence(tmp_path, typed):
    done = typed("data", "inspect", "gone.bag")
    assert done.returncode == 2
    assert done.stderr == "jerkbench: The file or folder gone.bag does not exist; correct the path.\n"
    done = typed("data", "inspect", "feild")
    assert "Did you mean 'field'?" in done.stderr
    (tmp_path / "a.xyz").touch()
    done = typed("data", "inspect", "a.xyz")
    assert "select the data set with --dataset NAME" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["inspect", "field", "--figure", "a.weird"], "There is no suffix of a figure '.weird'"),
        (["convert", "field", "file/a.csv"], "jerkbench: file cannot be read or written: File exists; correct the"),
        (["convert", "field", "a.csv", "--set", "duration"], "'duration' is not a parameter; give --set KEY=VALUE"),
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
        (["a.pos", "b.bag"], "can be read by rosbag or by rtklib; select the data set with --dataset NAME, one of "),
        (["a.pos", "oxts/data"], "can be read by rtklib or by kitti; select the data set with --dataset NAME"),
        (["a.txt"], "has no suffix and no files of a known data set; select the data set with --dataset NAME"),
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
    assert "rename the file so that its name ends in .bag" in typed("data", "inspect", "a.bag.active").stderr


def test_a_fixpositions_bag_is_recognised_with_its_shifts(tmp_path, typed):
    Drive(duration_s=4.0).write(tmp_path / "a.bag")
    given = ["imu_shift_s=-0.2", "velocity_latency_s=[0.1,0.1,0.1]"]
    said = typed("data", "inspect", "a.bag", "--dataset", "fixposition", "--set", *given).stdout
    assert "already shifted by imu_shift_s=-0.2, velocity_latency_s=(0.1, 0.1, 0.1); the lags above are the" in said
    assert "already shifted" not in typed("data", "inspect", "a.bag", "--dataset", "fixposition").stdout
    assert "of a Fixposition: use dataset=fixposition" in typed("data", "inspect", "a.bag").stdout


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
        (all_nan, "; NaN or infinite in 200 of 200 messages"),
        (absurd, "linear acceleration (median): "),
        (one_message_each, "1 usable messages are left"),
        (one_stamp, "200 messages, no rate, frame FP_POI"),
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
    assert "status (median): 2" in said
    assert "recorded 0.020 s after its stamp (0.020 to 0.020 s)" in said
    world, body = (said.split(f"/{name} (")[1].split("\n/")[0] for name in ("world", "body"))
    assert "position covariance (median): 0, 0, 0\n" in world
    assert "position (median): 450000, 5400019.5, 0\n" in body
    assert "linear covariance (median): 0.2, 0.2, 0.2" in body
    assert "3 of 20 rows have status -1 (no fix)" in said


def test_what_a_bag_lacks_is_an_answer(tmp_path, typed):
    drive = Drive(duration_s=2.0)
    del drive.rows["/fixposition/gnss1"]
    drive.write(tmp_path / "a.bag")
    done = typed("data", "inspect", "a.bag")
    assert done.returncode == 0, done.stderr
    assert "The source cannot be used as a recording: a.bag has no topic with GNSS fixes" in done.stdout
    (tmp_path / "b.bag").write_bytes((tmp_path / "a.bag").read_bytes()[:3000])
    done = typed("data", "inspect", "b.bag")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "`rosbag reindex`" in done.stderr


@pytest.mark.parametrize("seed", ["-1", "1.5", "x"])
def test_a_seed_is_a_whole_number(typed, seed):
    done = typed("data", "inspect", "field", "--seed", seed)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"'{seed}' is not a valid number; give an integer, 0 or more" in done.stderr


def test_what_is_kept_is_shown_and_cleared_and_nothing_else(tmp_path, typed, monkeypatch):
    cache = tmp_path / "cache"
    monkeypatch.setenv("JERKBENCH_CACHE", str(cache))
    monkeypatch.setattr(bag, "MIN_CACHED_BYTES", 0)
    Fixposition(str(Drive(duration_s=3.0).write(tmp_path / "a.bag"))).load(0)
    (cache / "compiled" / "run_mtf-1" / "mtf_1").mkdir(parents=True)
    for ours in ("run_mtf-1/lock", "run_mtf-1/mtf_1/mtf.run_mtf-1.py311.nbi"):
        (cache / "compiled" / ours).write_bytes(bytes(500_000))
    (cache / "mine.txt").touch()
    shown = typed("data", "cache").stdout
    assert f"compiled filters and adaptations: 2 files, 1.0 MB in {cache / 'compiled'}\n" in shown
    assert "messages of bags: 2 files, " in shown
    assert typed("data", "cache", "--clear").stdout.count(", deleted") == 2
    assert [path.name for path in cache.rglob("*") if path.is_file()] == ["mine.txt"]
    assert typed("data", "cache").stdout.count(": 0 files, 0.0 MB") == 3


def test_a_fetched_bag_needs_no_path(tmp_path, monkeypatch):
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    dataset = RosBag("fetched:somewhere/a.bag", position_topic="/fixposition/gnss1")
    with pytest.raises(RecordingError, match="fetch somewhere"):
        dataset.load(0)
    (tmp_path / "somewhere").mkdir()
    Drive(duration_s=3.0).write(tmp_path / "somewhere" / "a.bag")
    assert dataset.load(0).name == "a"
    assert dataset.fingerprint() == RosBag(str(tmp_path / "somewhere" / "a.bag")).fingerprint()


SENTENCE = "table: nothing measures the yaw"


@pytest.fixture
def log(tmp_path):
    """Half a minute at rest under noisy fixes."""
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 30.0, 0.05)
    sensed = np.column_stack([t_s, rng.normal(np.eye(6)[2] * 9.81, 0.05, (len(t_s), 6))])
    fixes = np.column_stack([np.arange(1.0, 29.0), rng.normal(0.0, 1.0, (28, 3))])
    for name, rows, header in (("imu", sensed, "t,ax,ay,az,gx,gy,gz"), ("fixes", fixes, "t,e,n,u")):
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=header, comments="")
    return {"folder": tmp_path, "position_file": "fixes.csv", "position_columns": "[e,n,u]", "position_frame": "enu"}


@pytest.mark.parametrize("sweep", [["-m", "workers=1", "report=false"], []])
def test_it_is_said_before_the_run_and_under_the_table(typed, log, sweep):
    chosen = [f"dataset.{name}={value}" for name, value in log.items()]
    done = typed("run", *sweep, "dataset=table", *chosen, "filter=gnss_only", "figures=false")

    assert done.returncode == 0, done.stderr
    assert SENTENCE in done.stderr
    assert SENTENCE in " ".join(done.stdout.split())


def test_inspection_says_it_too_with_every_set_counted(typed, log):
    chosen = [word for name, value in log.items() if name != "folder" for word in ("--set", f"{name}={value}")]
    done = typed("data", "inspect", str(log["folder"]), "--dataset", "table", *chosen)

    assert done.returncode == 0, done.stderr
    assert "position       28 rows" in done.stdout
    assert "yaw: nothing measures the yaw" in done.stdout


def test_a_mistake_is_told_before_the_run_with_its_remedy(typed, log):
    chosen = [f"dataset.{name}={value}" for name, value in (log | {"accel_unit": "g"}).items()]
    done = typed("run", "dataset=table", *chosen, "filter=gnss_only", "figures=false")

    assert "table: The accelerometer is 9.8 times too large" in done.stderr
    assert "accel_unit=m/s2" in done.stderr
