"""A large bag is read once: the second time from the cache, equal to the bit."""

import numpy as np
import pytest

from bag_maker import Drive
from jerkbench.arrays import identical
from jerkbench.datasets.rosbag import Fixposition, RosBag
from jerkbench.io import bag_extract as extract


@pytest.fixture
def bag(tmp_path, monkeypatch):
    """Every bag is worth keeping."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(extract, "WORTH_BYTES", 0)
    return Drive(duration_s=4.0).write(tmp_path / "a.bag")


def kept(folder):
    return sorted((folder / "cache" / "bags").glob("*.npz"))


def never(*_):
    raise AssertionError


def test_the_second_reading_is_the_first_without_the_bag(bag, tmp_path, monkeypatch):
    first = Fixposition(str(bag)).load(0)
    assert len(kept(tmp_path)) == 1
    monkeypatch.setattr(extract, "open_bag", never)
    assert identical(Fixposition(str(bag)).load(0), first)
    moved = bag.rename(tmp_path / "b.bag")  # it is the content that counts
    np.testing.assert_array_equal(Fixposition(str(moved)).load(0).imu.accel_mps2, first.imu.accel_mps2)


@pytest.mark.parametrize("changed", [{"velocity": "none"}, {"covariance_order": "enu"}, {"heading": "odometry"}])
def test_another_choice_is_another_reading(bag, tmp_path, changed):
    Fixposition(str(bag)).load(0)
    Fixposition(str(bag), **changed).load(0)
    RosBag(str(bag)).load(0)
    assert len(kept(tmp_path)) == 3


def test_another_content_is_another_reading(bag, tmp_path):
    before = Fixposition(str(bag)).load(0)
    bag.unlink()
    Drive(duration_s=3.0).write(bag)
    assert len(Fixposition(str(bag)).load(0).imu.t_s) == 150 < len(before.imu.t_s)
    assert len(kept(tmp_path)) == 2


@pytest.mark.parametrize("harm", [lambda c: c[: len(c) // 2], lambda _: b"", lambda c: b"\0" * len(c)])
def test_a_damaged_cache_is_read_again_from_the_bag(bag, tmp_path, harm):
    first = Fixposition(str(bag)).load(0)
    (file,) = kept(tmp_path)
    whole = file.read_bytes()
    file.write_bytes(harm(whole))
    assert identical(Fixposition(str(bag)).load(0), first)
    assert len(file.read_bytes()) == len(whole)


def test_a_flipped_byte_in_the_cache_never_shows(bag, tmp_path):
    first = Fixposition(str(bag)).load(0)
    (file,) = kept(tmp_path)
    whole, draw = file.read_bytes(), np.random.default_rng(5)
    for place in [*range(0, 400, 9), *draw.integers(len(whole), size=60), *range(len(whole) - 1500, len(whole), 60)]:
        content = bytearray(whole)
        content[place] ^= int(draw.integers(1, 256))
        file.write_bytes(content)
        found = extract._kept(file)
        if found is not None:  # a byte that says nothing
            file.write_bytes(whole)
            expected = extract._kept(file)
            for topic, messages in expected.raw.items():
                for name, value in messages.values.items():
                    np.testing.assert_array_equal(found.raw[topic][name], value)
    assert identical(Fixposition(str(bag)).load(0), first)


def test_a_cache_that_cannot_be_written_is_one_line(bag, tmp_path):
    (tmp_path / "cache").write_text("a file, where a folder should be")
    with pytest.warns(UserWarning, match="cannot be written"):
        recording = Fixposition(str(bag)).load(0)
    assert len(recording.imu.t_s) == 200


def test_a_bag_that_changes_while_it_is_read_is_not_kept(bag, tmp_path, monkeypatch):
    """Else what was read of the new bag would be the old one's for good."""
    read = extract._read

    def changing(path, planner):
        done = read(path, planner)
        path.write_bytes(path.read_bytes() + b"more")
        return done

    monkeypatch.setattr(extract, "_read", changing)
    Fixposition(str(bag)).load(0)
    assert kept(tmp_path) == []
