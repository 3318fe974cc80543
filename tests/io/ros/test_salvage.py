import re

import numpy as np
import pytest

from bag_maker import ROS1, ROS2, Drive, write_bag
from commands import verb
from jerkbench.datasets.rosbag import Fixposition
from jerkbench.io.bag import BagError, open_bag
from jerkbench.io.bag_salvage import salvage

COMPRESSIONS = [None, "lz4", "bz2"]


def in_small_chunks(path, compression=None, seconds=8.0):
    """A bag of many chunks: rosbags' own threshold is a megabyte."""
    from unittest import mock

    from rosbags.rosbag1 import Writer

    begin = Writer.__init__

    def small(self, *args, **kwargs):
        begin(self, *args, **kwargs)
        self.chunk_threshold = 16 * 1024

    drive = Drive(duration_s=seconds)
    with mock.patch.object(Writer, "__init__", small):
        write_bag(path, drive.rows, ROS1, compression)
    return drive


def contents(path):
    """Every message of a bag by topic, as bytes with its time."""
    from rosbags.highlevel import AnyReader

    found = {}
    with AnyReader([path]) as reader:
        for connection, t, raw in reader.messages():
            found.setdefault(connection.topic, []).append((t, bytes(raw)))
    return found


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_of_a_whole_bag_everything_is_saved(tmp_path, compression):
    in_small_chunks(tmp_path / "a.bag", compression)
    saved = salvage(tmp_path / "a.bag", tmp_path / "b.bag")
    assert contents(tmp_path / "b.bag") == contents(tmp_path / "a.bag")
    assert (saved.cut_chunks, saved.lost_bytes) == (0, 0)
    assert saved.chunks > 5


@pytest.mark.parametrize("part", [0.3, 0.5, 0.8, 0.93])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_bag_that_was_cut_keeps_all_before_the_cut(tmp_path, compression, part):
    in_small_chunks(tmp_path / "a.bag", compression)
    whole, content = contents(tmp_path / "a.bag"), (tmp_path / "a.bag").read_bytes()
    cut = bytearray(content[: int(part * len(content))])
    cut[:4096] = re.sub(rb"index_pos=.{8}", b"index_pos=" + bytes(8), bytes(cut[:4096]), flags=re.DOTALL)
    (tmp_path / "cut.bag").write_bytes(cut)
    with pytest.raises(BagError, match="jerkbench data salvage"), open_bag(tmp_path / "cut.bag"):
        pass
    salvage(tmp_path / "cut.bag", tmp_path / "b.bag")
    saved = contents(tmp_path / "b.bag")
    for topic, messages in saved.items():
        assert messages == whole[topic][: len(messages)]
    count, of = (sum(map(len, one.values())) for one in (saved, whole))
    assert count >= (part - 0.15) * of
    assert len(Fixposition(str(tmp_path / "b.bag")).load(0).imu.t_s) > 0.1 * 400


@pytest.mark.parametrize("where", ["size", "inside", "everything"])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_damaged_chunk_costs_no_other(tmp_path, compression, where):
    in_small_chunks(tmp_path / "a.bag", compression)
    whole, content = contents(tmp_path / "a.bag"), bytearray((tmp_path / "a.bag").read_bytes())
    starts = [found.start() - 8 for found in re.finditer(b"op=\x05", bytes(content))]
    begin, end = starts[3], starts[4]
    damaged = {"size": (begin, begin + 4), "inside": (begin + 100, begin + 150), "everything": (begin, end)}[where]
    content[slice(*damaged)] = bytes(255 for _ in range(*damaged))
    (tmp_path / "hurt.bag").write_bytes(content)
    saved = salvage(tmp_path / "hurt.bag", tmp_path / "b.bag")
    kept = contents(tmp_path / "b.bag")
    for topic, messages in kept.items():
        assert len(set(messages) - set(whole[topic])) <= (compression is None and where == "inside")  # no checksum
    lost = sum(map(len, whole.values())) - sum(map(len, kept.values()))
    assert lost > 0 or (compression is None and where == "inside")
    assert lost <= 1.2 * sum(map(len, whole.values())) / (len(starts) - 1)
    assert saved.cut_chunks or saved.lost_bytes or not lost


def test_the_verb_says_what_it_saved_and_what_it_cannot(tmp_path):
    in_small_chunks(tmp_path / "a.bag", seconds=4.0)
    content = (tmp_path / "a.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(content[: len(content) // 2])
    done = verb("data", "salvage", "cut.bag", "b.bag", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.match(r"b\.bag: \d+ messages from \d chunks\n  /fixposition/gnss1: \d+\n", done.stdout)
    again = verb("data", "salvage", "cut.bag", "b.bag", cwd=tmp_path)
    assert (again.returncode, again.stderr) == (
        2,
        "jerkbench: b.bag is there already; delete it or give another name.\n",
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "There is no bag"),
        (b"", "is no ROS 1 bag by its first bytes"),
        (b"SQLite format 3\0" + bytes(100), "is no ROS 1 bag by its first bytes"),
        (b"#ROSBAG V2.0\n" + bytes(5000), "has no whole message in it"),
        (b"#ROSBAG V2.0\n" + bytes(range(256)) * 40, "has no whole message in it"),
    ],
)
def test_where_nothing_can_be_saved_nothing_is_written(tmp_path, content, said):
    if content is not None:
        (tmp_path / "a.bag").write_bytes(content)
    with pytest.raises(BagError, match=said):
        salvage(tmp_path / "a.bag", tmp_path / "b.bag")
    assert not (tmp_path / "b.bag").exists()
    with pytest.raises(BagError):
        salvage(tmp_path / "a.bag", tmp_path / "b.txt")


def test_a_real_bag_survives_its_cut(tmp_path, shared_folder):
    path = shared_folder / "data" / "robot_localization" / "test1.bag"
    if not path.exists():
        pytest.skip("the bags of robot_localization are not in ../shared/data")
    content = path.read_bytes()
    (tmp_path / "cut.bag").write_bytes(content[: len(content) // 2])
    saved = salvage(tmp_path / "cut.bag", tmp_path / "b.bag")
    assert set(saved.messages) == {"/fix", "/imu/data", "/husky_velocity_controller/odom"}
    with open_bag(tmp_path / "b.bag") as bag:
        values = bag.read({"/imu/data": ["linear_acceleration"]})["/imu/data"]["linear_acceleration"]
    with open_bag(path) as bag:
        whole = bag.read({"/imu/data": ["linear_acceleration"]})["/imu/data"]["linear_acceleration"]
    np.testing.assert_array_equal(values, whole[: len(values)])
    assert len(values) > 0.3 * len(whole)


def test_ros_2_is_refused_by_name(tmp_path):
    path = Drive(ROS2, duration_s=2.0).write(tmp_path / "a.mcap")
    with pytest.raises(BagError, match="mcap recover"):
        salvage(next(path.glob("*.mcap")), tmp_path / "b.bag")
