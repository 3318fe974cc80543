import pytest

from bag_maker import Drive
from jerkbench.datasets.rosbag import Fixposition, RosBag
from jerkbench.errors import RecordingError
from jerkbench.io import bag


def test_what_is_kept_is_shown_and_cleared_and_nothing_else(tmp_path, typed, monkeypatch):
    cache = tmp_path / "cache"
    monkeypatch.setenv("JERKBENCH_CACHE", str(cache))
    monkeypatch.setattr(bag, "MIN_CACHED_BYTES", 0)
    Fixposition(str(Drive(duration_s=3.0).write(tmp_path / "a.bag"))).load(0)
    (cache / "compiled" / "__pycache__").mkdir(parents=True)
    for ours in ("jerkbench_mtf_1.py", "__pycache__/jerkbench_mtf_1.nbi"):
        (cache / "compiled" / ours).write_bytes(bytes(500_000))
    (cache / "mine.txt").touch()
    shown = typed("data", "cache").stdout
    assert f"compiled filters and adaptations: 2 files, 1.0 MB in {cache / 'compiled'}\n" in shown
    assert "messages of bags: 4 files, " in shown
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
