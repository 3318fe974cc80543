"""Of several processes on one folder, each bundle is one's; what a dead one claimed is another's."""

import os
import subprocess
import sys

import pytest

from jerkbench.sweep import claims as module
from jerkbench.sweep.claims import Claims, machine


@pytest.fixture
def two(tmp_path):
    with Claims(tmp_path / "claims", "plan") as first, Claims(tmp_path / "claims", "plan") as second:
        yield first, second


def left_by(folder, owner, bundle=7):
    (folder / f"{owner}.process").touch()
    (folder / f"plan.{bundle}.0.claim").write_text(owner)
    return folder / f"{owner}.process"


def ended_process():
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    return done.pid


def test_one_of_two_gets_a_bundle_and_the_other_when_it_is_given_up(two):
    first, second = two

    assert [first.take(7), second.take(7), second.take(8), first.take(8)] == [True, False, True, False]
    first.release(7)
    assert second.take(7)


def test_a_process_of_this_machine_that_has_ended_has_lost_its_claims_at_once(two):
    first, second = two
    left_by(first.folder, f"{machine()}.{ended_process()}.0123456789ab")

    assert first.take(7)
    assert not second.take(7)
    first.release(7)
    assert not list(first.folder.glob("plan.7.*"))


@pytest.mark.parametrize(("silent_s", "taken"), [(module.LIMIT_S - 30, False), (module.LIMIT_S + 30, True)])
def test_a_process_of_another_machine_has_lost_its_claims_after_a_time(two, silent_s, taken):
    first, _ = two
    other = left_by(first.folder, "elsewhere_1.4711.0123456789ab")
    then = first._now() - silent_s
    os.utime(other, (then, then))

    assert first.take(7) is taken


def test_a_claim_that_was_never_written_is_lost_after_a_time(two):
    first, _ = two
    path = first.folder / "plan.7.0.claim"
    path.touch()
    assert not first.take(7)

    os.utime(path, (0, 0))
    assert first.take(7)


def test_each_knows_that_it_is_not_alone_even_when_the_other_has_left(tmp_path):
    with Claims(tmp_path / "claims", "plan") as first:
        assert first.alone()
        with Claims(tmp_path / "claims", "plan") as second:
            assert not first.alone()
            assert second.take(7)
        assert not first.alone()
        assert first.take(7)
    assert not (tmp_path / "claims").exists()


def test_a_process_that_lives_is_heard_of(tmp_path, monkeypatch):
    """Its file is touched again, whatever its time was."""
    monkeypatch.setattr(module, "BEAT_S", 0.01)
    with Claims(tmp_path / "claims", "plan") as first:
        os.utime(first.mark, (0, 0))
        while first.mark.stat().st_mtime < 1:
            assert first._thread.is_alive()
