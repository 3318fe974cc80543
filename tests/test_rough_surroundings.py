"""An environment that is not as one expects it: a sentence, and no traceback."""

import subprocess
import sys

import pytest

from commands import environment, verb


def shell(line, cwd):
    """Run a line in which PROGRAM stands for the command."""
    command = ["sh", "-c", line.replace("PROGRAM", '"$0" -m jerkbench'), sys.executable]
    return subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_a_closed_stream_is_no_fault(tmp_path, closed):
    done = shell(f"PROGRAM list filter {closed}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("words", ["list", "run --help", "run --dry dataset.duration_s=8"])
def test_a_full_disk_behind_standard_output_is_a_sentence(tmp_path, words):
    done = shell(f"PROGRAM {words} > /dev/full", tmp_path)
    assert done.returncode == 2
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_date_that_is_none_is_refused_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "x")
    done = verb("list", cwd=tmp_path)
    assert done.returncode == 2
    assert "SOURCE_DATE_EPOCH is 'x'" in done.stderr


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ChildProcessError("the process that ran it died (killed by signal 9)"), "A worker process ended early"),
        (MemoryError("Unable to allocate 8.00 TiB for an array"), "8.00 TiB"),
    ],
)
@pytest.mark.parametrize(
    ("words", "place"),
    [(["list"], "jerkbench.plugins.catalogue.list_text"), (["run"], "jerkbench.hydra_app.app.prepared_app")],
)
def test_a_worker_that_died_and_too_little_memory_are_a_sentence(tmp_path, monkeypatch, words, place, error, said):
    def fail(_):
        raise error

    monkeypatch.setattr(place, fail)
    done = verb(*words, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "path" not in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", ["list", "run dataset.duration_s=8"])
def test_less_memory_than_the_libraries_need_is_refused_at_once(tmp_path, words):
    done = shell(f"ulimit -v 500000; PROGRAM {words}", tmp_path)
    assert done.returncode == 2
    assert "488 MiB" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("word", "asked"),
    [("study=grün", "study='grün'"), ("notes=[grün]", "notes=['grün']"), ("study=it's", "study='it\\'s'")],
)
def test_text_beyond_the_grammar_needs_quotation_marks(tmp_path, word, asked):
    done = verb("run", "--dry", "dataset.duration_s=8", word, cwd=tmp_path)
    assert done.returncode == 2
    assert f"'{word}' cannot be read; give KEY=VALUE, and put text" in done.stderr
    assert done.stderr.count("\n") == 1
    assert verb("run", "--dry", "dataset.duration_s=8", asked, cwd=tmp_path).returncode == 0
