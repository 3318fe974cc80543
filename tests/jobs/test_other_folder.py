"""Results in a folder elsewhere: a sweep that is interrupted there, goes on, and is tabled."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest

from commands import SHORT, verb
from jerkbench.files import write_text
from jerkbench.jobs import run
from jerkbench.jobs.manifest import MANIFEST, read_manifest
from jerkbench.jobs.store import Store

WORDS = ("run", "-m", *SHORT, "filter=jerk,baseline", "adaptation=none,mtf")


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    assert verb(*WORDS, cwd=folder).returncode == 0
    return (folder / "results/adhoc/rows.csv").read_bytes()


def interrupted_after(cells, monkeypatch):
    add = run.Writer.add

    def adding(writer, table, seen=[0]):  # noqa: B006 - a count
        add(writer, table)
        seen[0] += 1
        if seen[0] > cells:
            raise KeyboardInterrupt

    monkeypatch.setattr(run.Writer, "add", adding)
    monkeypatch.setattr(run, "MAX_FLUSH_S", 0.0)


@pytest.mark.slow
def test_a_sweep_that_is_interrupted_goes_on_and_is_tabled(expected, tmp_path, tmp_path_factory, monkeypatch):
    results = tmp_path_factory.mktemp("elsewhere") / "results"
    with monkeypatch.context() as patched:
        interrupted_after(1, patched)
        first = verb(*WORDS, f"results={results}", cwd=tmp_path)
    assert first.returncode == 130
    study = results / "adhoc"
    assert len(Store(study).keys_from("")) == 2

    again = verb(*WORDS, f"results={results}", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "2 of 4 cells are done already" in again.stderr
    assert (study / "rows.csv").read_bytes() == expected
    shown = verb("table", str(results / "adhoc"), cwd=tmp_path)
    assert "Position RMSE" in shown.stdout
    assert verb("rerun", str(results / "adhoc"), "1", cwd=tmp_path).returncode == 0
    assert list(tmp_path.iterdir()) == []  # nothing is written into the working directory


def test_a_manifest_that_another_process_writes_anew_is_read_as_it_was_or_is(tmp_path):
    study = tmp_path / "adhoc"
    versions = [json.dumps({"cells": ["a"], "last": [], "finished": str(k)}) for k in range(60)]
    write_text(study / MANIFEST, versions[0])
    with ThreadPoolExecutor(1) as pool:
        writing = pool.submit(lambda: [write_text(study / MANIFEST, version) for version in versions])
        read = [read_manifest(study)]
        while not writing.done():
            read.append(read_manifest(study))

    assert len(read) > 5
    assert all(json.dumps(manifest) in versions for manifest in read)
