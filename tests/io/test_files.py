import hashlib
import os

import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.files import find_file, fingerprint


def test_the_one_file_with_the_suffix_is_found(tmp_path):
    (tmp_path / "a.csv").touch()
    (tmp_path / "a.csv.tag").touch()
    assert find_file(tmp_path, "", ".csv", "imu_file") == tmp_path / "a.csv"
    assert find_file(tmp_path, "a.csv.tag", ".csv", "imu_file") == tmp_path / "a.csv.tag"


def test_none_several_and_missing_are_named(tmp_path):
    with pytest.raises(RecordingError, match="position_file"):
        find_file(tmp_path, "", ".pos", "position_file")
    (tmp_path / "a.pos").touch()
    (tmp_path / "b.pos").touch()
    with pytest.raises(RecordingError, match=r"has 2 files \(a\.pos, b\.pos\)"):
        find_file(tmp_path, "", ".pos", "position_file")
    with pytest.raises(RecordingError, match=r"c\.pos.*position_file"):
        find_file(tmp_path, "c.pos", ".pos", "position_file")
    with pytest.raises(RecordingError, match="There is no folder"):
        find_file(tmp_path / "gone", "", ".pos", "position_file")


def test_the_fingerprint_follows_the_bytes(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_bytes(b"first")
    two.write_bytes(b"second")
    digests = hashlib.sha256(b"first").hexdigest() + hashlib.sha256(b"second").hexdigest()
    before = fingerprint((one, two))
    assert before == hashlib.sha256(digests.encode()).hexdigest()
    one.write_bytes(b"First")
    os.utime(one, ns=(1, 1))
    assert fingerprint((one, two)) != before
    assert fingerprint((two, one)) != fingerprint((one, two))
