"""A file of compiled code is believed only if this user alone can have written it, and it is what was written."""

import os

import pytest

from jerkbench.compilation.module_cache import read_kept, write_kept
from jerkbench.files import Distrusted

SOURCE = "x = 1\n"
FILES = {"ours.py": SOURCE.encode(), "__pycache__/ours.1.nbc": bytes(range(256)) * 20, "__pycache__/ours.nbi": b""}


@pytest.fixture
def kept(tmp_path):
    """A file that was written just now."""
    path = tmp_path / "deep" / "ours.compiled"
    write_kept(path, FILES)
    return path


def test_what_was_kept_comes_back(kept):
    assert read_kept(kept, "ours", SOURCE) == FILES


def test_where_there_is_nothing_nothing_comes_back(tmp_path):
    assert read_kept(tmp_path / "none.compiled", "none", SOURCE) is None


@pytest.mark.parametrize("begin", [0, 64, 65, 70, 120, 3000, -7])
def test_seven_bytes_of_garbage_are_noticed_anywhere(kept, begin):
    content = kept.read_bytes()
    place = begin % len(content)
    kept.write_bytes(content[:place] + b"garbage" + content[place + 7 :])

    with pytest.raises(Distrusted, match="not what was written"):
        read_kept(kept, "ours", SOURCE)


@pytest.mark.parametrize("length", [0, 40, 65, 100, 5000])
def test_what_was_cut_off_is_noticed(kept, length):
    kept.write_bytes(kept.read_bytes()[:length])

    with pytest.raises(Distrusted, match="not what was written"):
        read_kept(kept, "ours", SOURCE)


@pytest.mark.parametrize(("name", "source"), [("theirs", SOURCE), ("ours", "x = 2\n")])
def test_code_of_something_else_is_noticed(kept, name, source):
    with pytest.raises(Distrusted, match="belongs to something else"):
        read_kept(kept, name, source)


@pytest.mark.parametrize("mode", [0o660, 0o602, 0o666])
def test_what_others_may_write_to_is_not_believed(kept, mode):
    kept.chmod(mode)

    with pytest.raises(Distrusted, match="others may write to it"):
        read_kept(kept, "ours", SOURCE)


def test_what_others_may_only_read_is(kept):
    kept.chmod(0o644)
    assert read_kept(kept, "ours", SOURCE) == FILES


def test_what_belongs_to_another_user_is_not_believed(kept, monkeypatch):
    theirs = os.stat_result((0o100600, 0, 0, 1, os.geteuid() + 1, *[0] * 5))
    monkeypatch.setattr(os, "fstat", lambda _: theirs)

    with pytest.raises(Distrusted, match="belongs to another user"):
        read_kept(kept, "ours", SOURCE)


def test_it_is_written_for_this_user_alone_whatever_the_umask_allows(tmp_path):
    before = os.umask(0)
    try:
        write_kept(tmp_path / "ours.compiled", FILES)
    finally:
        os.umask(before)

    assert (tmp_path / "ours.compiled").stat().st_mode & 0o777 == 0o600
