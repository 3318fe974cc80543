"""Files that are damaged, cut, or no bags: each ends in one sentence; never in a traceback."""

import re
import shutil

import numpy as np
import pytest

from bag_maker import IMU_TYPE, ROS1, ROS2, Drive, fixposition, imu, write_bag
from jerkbench.datasets.rosbag import RosBag
from jerkbench.errors import RecordingError

FORMATS = {"none": (ROS1, "a.bag", None), "lz4": (ROS1, "a.bag", "lz4"), "bz2": (ROS1, "a.bag", "bz2")}
FORMATS |= {"db3": (ROS2, "a", None), "mcap": (ROS2, "a.mcap", None), "zstd": (ROS2, "a.mcap", "storage")}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """One bag of each format, as the file that is to be harmed, and what it holds."""
    made = {}
    for name, (store, file, compression) in FORMATS.items():
        path = Drive(store, duration_s=4.0).write(tmp_path_factory.mktemp(name) / file, compression)
        if path.is_dir():
            (path,) = (p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
        made[name] = path
    return made, fixposition(str(made["none"])).load(0)


def harmed(path, folder, change):
    content = bytearray(path.read_bytes())
    target = folder / f"harmed{path.suffix}"
    target.write_bytes(change(content))
    return str(target)


@pytest.mark.parametrize("part", [0.001, 0.05, 0.6, 0.99, 0.9999])
@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_was_cut_is_one_sentence(tmp_path, sound, name, part):
    path = harmed(sound[0][name], tmp_path, lambda content: content[: int(part * len(content))])
    try:
        recording = fixposition(path).load(0)
    except RecordingError as error:
        assert re.search("[Cc]opy the (file|bag) again|record the bag again|is empty", str(error))  # noqa: PT017 - either is right
    else:  # SQLite needs not the last bytes of its last page
        assert (name, part) == ("db3", 0.9999)
        np.testing.assert_array_equal(recording.imu.accel_mps2, sound[1].imu.accel_mps2)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", FORMATS)
def test_flipped_bytes_end_in_a_sentence_or_in_the_same_drive_without_the_worst(tmp_path, sound, name, seed):
    """Twenty bytes somewhere. No format has a checksum for all its parts: only what is possible can be asked for."""
    draw = np.random.default_rng([seed, len(name)])

    def flip(content):
        begin = int(draw.uniform() ** 2 * len(content)) if seed % 2 else int(draw.uniform() * len(content))
        for k in range(begin, min(begin + 20, len(content))):
            content[k] ^= int(draw.integers(1, 256))
        return content

    try:
        recording = fixposition(harmed(sound[0][name], tmp_path, flip)).load(0)
    except RecordingError as error:
        assert len(str(error)) > 40  # noqa: PT017 - the drive itself is right too
        return
    as_it_was = sound[1]
    assert len(recording.imu.t_s) >= 190
    same = np.isin(recording.imu.accel_mps2, as_it_was.imu.accel_mps2).all(axis=1)
    assert same.mean() > 0.9  # a byte in a compressed chunk is copied to some messages more
    assert np.abs(recording.imu.accel_mps2).max() <= 1000
    assert np.abs(recording.position.enu_m[:, :2]).max() < 200


@pytest.mark.parametrize("name", ["none", "db3", "mcap"])
def test_an_empty_file(tmp_path, sound, name):
    with pytest.raises(RecordingError, match="is empty; copy the file again"):
        fixposition(harmed(sound[0][name], tmp_path, lambda _: b"")).load(0)


@pytest.mark.parametrize(("name", "suffix"), [("none", ".db3"), ("db3", ".bag"), ("mcap", ".bag"), ("mcap", ".txt")])
def test_a_wrong_suffix_is_named(tmp_path, sound, name, suffix):
    path = tmp_path / f"wrong{suffix}"
    shutil.copy(sound[0][name], path)
    with pytest.raises(RecordingError, match=r"rename.*\.(bag|db3|mcap)"):
        fixposition(str(path)).load(0)


def test_what_is_no_bag_and_damaged_metadata_are_sentences(tmp_path):
    (tmp_path / "a.bag").write_text("stamp,x,y\n1,2,3\n")
    with pytest.raises(RecordingError, match="is neither a ROS 1 bag"):
        RosBag(str(tmp_path / "a.bag")).load(0)
    with pytest.raises(RecordingError, match="There is no file"):
        RosBag(str(tmp_path / "b.bag")).load(0)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"contains no metadata\.yaml and no \.bag"):
        RosBag(str(tmp_path / "empty")).load(0)
    path = Drive(ROS2, duration_s=3.0).write(tmp_path / "a")
    metadata = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(metadata.replace("a.db3", "b.db3"))
    with pytest.raises(RecordingError, match="Some database files are missing"):
        fixposition(str(path)).load(0)
    for broken in (metadata[: len(metadata) // 2], "{[", "", metadata.replace("version: 9", "version: nine")):
        (path / "metadata.yaml").write_text(broken)
        with pytest.raises(RecordingError, match="ros2 bag reindex"):
            fixposition(str(path)).load(0)
    (path / "metadata.yaml").unlink()
    (path / "more.db3").write_bytes(next(path.glob("*.db3")).read_bytes())
    with pytest.raises(RecordingError, match=r"2 files .*metadata\.yaml"):
        fixposition(str(path)).load(0)


@pytest.mark.parametrize(("store", "name"), [(ROS1, "a.bag"), (ROS2, "a"), (ROS2, "a.mcap")])
def test_no_topics_and_no_messages(tmp_path, store, name):
    with pytest.raises(RecordingError, match=r"contains 0 topics but no message"):
        RosBag(str(write_bag(tmp_path / name, {}, store))).load(0)
    path = write_bag(tmp_path / f"b{name}", {}, store, empty={"/imu": IMU_TYPE})
    with pytest.raises(RecordingError, match=r"no message|0 topics"):
        RosBag(str(path)).load(0)


def test_too_few_messages_another_time_and_another_type_are_sentences(tmp_path):
    drive = Drive(duration_s=3.0)
    del drive.rows["/fixposition/gnss1"][1:]
    with pytest.raises(RecordingError, match=r"gnss1\): 1 usable"):
        fixposition(str(drive.write(tmp_path / "a.bag"))).load(0)
    drive = Drive(duration_s=3.0)
    for row in drive.rows["/fixposition/gnss1"]:
        row[0] += 3600 * 10**9
        row[2].header.stamp.sec += 3600
    with pytest.raises(RecordingError, match="do not overlap in time"):
        fixposition(str(drive.write(tmp_path / "b.bag"))).load(0)
    drive = Drive(duration_s=3.0)
    drive.rows["/fixposition/gnss1"] = [[row[0], *imu(ROS1, row[0])] for row in drive.rows["/fixposition/gnss1"]]
    with pytest.raises(RecordingError, match="sensor_msgs/msg/Imu"):
        fixposition(str(drive.write(tmp_path / "c.bag"))).load(0)


def split(drive, folder, parts):
    """Write a drive as parts of equal length, as `rosbag record --split` does."""
    folder.mkdir()
    for k in parts:
        rows = {topic: some[k * len(some) // 3 : (k + 1) * len(some) // 3] for topic, some in drive.rows.items()}
        write_bag(folder / f"drive_2023-11-14-22-13-20_{k}.bag", rows, ROS1)
    return str(folder)


def test_a_split_bag_is_one_drive_and_a_missing_part_is_said(tmp_path):
    drive = Drive(duration_s=6.0)
    whole = fixposition(str(drive.write(tmp_path / "a.bag"))).load(0)
    joined = fixposition(split(drive, tmp_path / "all", [0, 1, 2])).load(0)
    np.testing.assert_array_equal(joined.imu.accel_mps2, whole.imu.accel_mps2)
    assert joined.notes == whole.notes
    lacking = fixposition(split(drive, tmp_path / "two", [0, 2])).load(0)
    assert lacking.notes[0] == "Parts [1] of the split bag are missing."
    assert any("a gap before them, up to 2.02 s" in note for note in lacking.notes)


def test_bags_of_different_drives_in_one_folder_are_not_joined(tmp_path):
    drive = Drive(duration_s=3.0)
    for name in ("test1.bag", "xsens.bag"):
        drive.write(tmp_path / name)
    with pytest.raises(RecordingError, match=r"test1\.bag, xsens\.bag"):
        fixposition(str(tmp_path)).load(0)
    (tmp_path / "test1.bag").rename(tmp_path / "drive_2023-11-14-22-13-20_0.bag")
    (tmp_path / "xsens.bag").rename(tmp_path / "other_2023-11-14-22-14-20_1.bag")
    with pytest.raises(RecordingError, match=r"NAME_0\.bag"):
        fixposition(str(tmp_path)).load(0)
    (tmp_path / "other_2023-11-14-22-14-20_1.bag").rename(tmp_path / "drive_2023-11-14-22-14-20_1.bag")
    assert len(fixposition(str(tmp_path)).load(0).imu.t_s) == 150  # each stamp is there twice
