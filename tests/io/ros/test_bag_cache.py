"""A large bag is decoded once: the second time its messages come from the cache, equal to the bit."""

import numpy as np
import pytest

from bag_maker import Drive, fixposition
from jerkbench.arrays import identical
from jerkbench.datasets.rosbag import RosBag
from jerkbench.io import bag as bags


@pytest.fixture
def bag(tmp_path, monkeypatch):
    """Every bag is large enough for the cache."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(bags, "MIN_CACHED_BYTES", 0)
    return Drive(duration_s=4.0).write(tmp_path / "a.bag")


def stored(folder):
    return sorted((folder / "cache" / "bags").glob("*.pickle"))


def test_the_second_reading_decodes_nothing(bag, tmp_path, monkeypatch):
    first = fixposition(str(bag)).load(0)
    assert len(stored(tmp_path)) == 1
    monkeypatch.delattr(bags._Columns, "append")
    assert identical(fixposition(str(bag)).load(0), first)
    moved = bag.rename(tmp_path / "b.bag")  # it is the content that counts
    np.testing.assert_array_equal(fixposition(str(moved)).load(0).imu.accel_mps2, first.imu.accel_mps2)


def test_other_fields_and_another_content_are_decoded_again(bag, tmp_path):
    fixposition(str(bag)).load(0)
    fixposition(str(bag), covariance_order="enu").load(0)
    assert len(stored(tmp_path)) == 1
    fixposition(str(bag), heading_topic="/fixposition/odometry_ecef").load(0)
    assert len(stored(tmp_path)) == 2
    assert RosBag(str(bag)).load(0).velocity is not None
    before = fixposition(str(bag)).load(0)
    bag.unlink()
    Drive(duration_s=3.0).write(bag)
    assert len(fixposition(str(bag)).load(0).imu.t_s) == 150 < len(before.imu.t_s)


@pytest.mark.parametrize("harm", [lambda c: c[: len(c) // 2], lambda _: b"", lambda c: b"\0" * len(c)])
def test_a_damaged_cache_is_read_again_from_the_bag(bag, tmp_path, harm):
    first = fixposition(str(bag)).load(0)
    for file in stored(tmp_path):
        whole = file.read_bytes()
        file.write_bytes(harm(whole))
        assert identical(fixposition(str(bag)).load(0), first)
        assert len(file.read_bytes()) == len(whole)


def test_a_flipped_byte_in_the_cache_never_shows(bag, tmp_path):
    fixposition(str(bag)).load(0)
    file = max(stored(tmp_path), key=lambda path: path.stat().st_size)
    whole, random = file.read_bytes(), np.random.default_rng(5)
    for place in [*range(0, 400, 9), *random.integers(len(whole), size=60), *range(len(whole) - 1500, len(whole), 60)]:
        content = bytearray(whole)
        content[place] ^= int(random.integers(1, 256))
        file.write_bytes(content)
        assert bags.read_stored(file) is None


def test_a_cache_that_cannot_be_written_is_one_line(bag, tmp_path):
    (tmp_path / "cache").write_text("a file, where a folder should be")
    with pytest.warns(UserWarning, match="cannot be written"):
        recording = fixposition(str(bag)).load(0)
    assert len(recording.imu.t_s) == 200


def test_a_bag_that_changes_while_it_is_read_is_not_stored(bag, tmp_path, monkeypatch):
    decoded = bags.Bag._decoded

    def changing(self, *wanted):
        done = decoded(self, *wanted)
        self.path.write_bytes(self.path.read_bytes() + b"more")
        return done

    monkeypatch.setattr(bags.Bag, "_decoded", changing)
    fixposition(str(bag)).load(0)
    assert stored(tmp_path) == []
