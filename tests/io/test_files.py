import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.files import find_file


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
