"""Results in an object store: a sweep that is interrupted there, goes on, and is tabled."""

import json
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from commands import SHORT, verb
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_text
from jerkbench.places import is_remote, place
from jerkbench.results.manifest import MANIFEST, read_manifest
from jerkbench.results.store import Store
from jerkbench.sweep import writer
from jerkbench.sweep.sweep import Tally

WORDS = ("run", "-m", *SHORT, "filter=jerk,baseline", "adaptation=none,mtf")


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    assert verb(*WORDS, cwd=folder).returncode == 0
    return (folder / "results/adhoc/rows.csv").read_bytes()


def interrupted_after(cells, monkeypatch):
    add = Tally.add

    def adding(tally, task, result, seen=[0]):  # noqa: B006 - a count
        seen[0] += 1
        if seen[0] > cells:
            raise KeyboardInterrupt
        return add(tally, task, result)

    monkeypatch.setattr(Tally, "add", adding)
    monkeypatch.setattr(writer, "HELD_S", 0.0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_a_sweep_that_is_interrupted_goes_on_and_is_tabled(address, expected, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        interrupted_after(1, patched)
        first = verb(*WORDS, f"results={address}", cwd=tmp_path)
    assert first.returncode == 130
    study = place(f"{address}/adhoc")
    assert len(Store(study).keys_from("")) == 2

    again = verb(*WORDS, f"results={address}", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "2 of 4 cells are done already" in again.stderr
    assert (study / "rows.csv").read_bytes() == expected
    shown = verb("table", f"{address}/adhoc", cwd=tmp_path)
    assert "Position RMSE" in shown.stdout
    assert verb("rerun", f"{address}/adhoc", "1", cwd=tmp_path).returncode == 0
    assert list(tmp_path.iterdir()) == []  # nothing is written into the working directory


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("address", ["s3"], indirect=True)
def test_a_folder_that_ends_while_it_is_listed_is_an_empty_one(address, monkeypatch):
    """All that it held was the probe of another process, which begins at the same moment."""
    study = place(f"{address}/begun")
    probe = study / "cells" / ".probe.1"
    of = type(study.fs)._isdir

    async def there_and_gone(files, path):
        there = await of(files, path)
        if path.endswith("begun/cells"):
            await files._rm_file(probe.path)
        return there

    monkeypatch.setattr(type(study.fs), "_isdir", there_and_gone)
    probe.touch()
    assert Store(study).keys_from("") == []
    assert not probe.exists()


def test_a_manifest_that_another_process_writes_anew_is_read_as_it_was_or_is(address):
    study = place(f"{address}/adhoc")
    versions = [json.dumps({"cells": ["a"], "last": [], "finished": str(k)}) for k in range(60)]
    write_text(study / MANIFEST, versions[0])
    with ThreadPoolExecutor(1) as pool:
        writing = pool.submit(lambda: [write_text(study / MANIFEST, version) for version in versions])
        read = [read_manifest(study)]
        while not writing.done():
            read.append(read_manifest(study))

    assert len(read) > 5
    assert all(json.dumps(manifest) in versions for manifest in read)


def test_a_file_s_address_is_a_folder_of_this_machine(tmp_path):
    folder = place(f"file://{tmp_path}/results")
    assert folder == tmp_path / "results"
    assert not is_remote(folder)
    write_text(folder / "a.txt", "text")
    assert (tmp_path / "results/a.txt").read_text() == "text"


def test_an_address_that_nobody_knows_is_a_sentence(tmp_path):
    pytest.importorskip("upath")
    with pytest.raises(JerkbenchError, match="kind of address"):
        place("s4://bucket/folder")
    done = verb("run", *SHORT, "results=s4://bucket", cwd=tmp_path)
    assert done.returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "upath", None)
    with pytest.raises(JerkbenchError, match=r"jerkbench\[remote\]"):
        place("s3://bucket/folder")


def test_a_damaged_part_in_an_object_store_is_set_aside():
    pytest.importorskip("upath")
    folder = place("memory://damaged/study/cells")
    folder.mkdir(parents=True)
    (folder / "b0.parquet").write_bytes(b"PAR1")
    store = Store(folder.parent)

    assert store.look(["b0"]).damaged == ["b0"]
    store.set_aside(["b0"])
    assert store.look(["b0"]).damaged == []
