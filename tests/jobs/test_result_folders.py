"""Folders of results: shared by several processes, elsewhere, and read-only."""

import json
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pytest

from commands import PATIENCE_S, SHORT, environment, verb
from jerkbench import api
from jerkbench.files import write_text
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.key import MANIFEST, read_manifest
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import job_rows
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from made_jobs import job_with


def test_a_row_that_two_sweeps_have_computed_counts_once(tmp_path):
    plan = planned([job_with(Protocol(seeds=3, burn_in_s=0.0), filter="gnss_only", engine="filterpy")])
    both = threading.Barrier(2, timeout=PATIENCE_S)
    stores = [Store(tmp_path), Store(tmp_path)]
    for store in stores:
        known = store.known
        store.known = lambda *keys, known=known: (both.wait(), known(*keys))[1]  # both find nothing
    sweeps = [threading.Thread(target=run_missing, args=(plan, store)) for store in stores]
    for thread in sweeps:
        thread.start()
    for thread in sweeps:
        thread.join(PATIENCE_S)

    assert len(list(stores[0].folder.glob("*.parquet"))) >= 2
    (stored,), damaged = Store(tmp_path).read([plan.jobs[0].key])
    pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(job_rows(plan.jobs[0])[0]), check_exact=True)
    assert damaged == []


@pytest.mark.slow
def test_two_processes_with_some_seeds_in_common_give_the_rows_of_one(tmp_path, tmp_path_factory):
    words = ["run", "-m", "filter=gnss_only,jerk", "disturbance=none,outliers", "dataset.duration_s=12", "workers=1"]
    alone = tmp_path_factory.mktemp("alone")
    assert verb(*words, "seeds=5", cwd=alone).returncode == 0
    command = [sys.executable, "-m", "jerkbench", *words, "seeds=3"]
    here = {"cwd": tmp_path, "env": environment(), "stdout": subprocess.DEVNULL}
    parts = [subprocess.Popen([*command, f"first_seed={first}"], **here) for first in (0, 2)]
    assert [part.wait(PATIENCE_S) for part in parts] == [0, 0]

    rows, wanted = (
        {cell.key: cell.rows for cell in Store(folder / "results" / "adhoc").read(shown={})[0]}
        for folder in (tmp_path, alone)
    )
    assert rows.keys() == wanted.keys()
    for key, of_cell in rows.items():
        pd.testing.assert_frame_equal(of_cell, wanted[key], check_exact=True)
        assert list(of_cell["seed"]) == [0, 1, 2, 3, 4]
    assert {path.suffix for path in (tmp_path / "results" / "adhoc" / "cells").iterdir()} == {".parquet"}


def test_results_elsewhere_leave_the_working_directory_empty(tmp_path, tmp_path_factory):
    results = tmp_path_factory.mktemp("elsewhere") / "results"
    assert verb("run", "-m", *SHORT, "filter=jerk,baseline", f"results={results}", cwd=tmp_path).returncode == 0
    assert "Position RMSE" in verb("table", results / "adhoc", cwd=tmp_path).stdout
    assert verb("rerun", results / "adhoc", "1", cwd=tmp_path).returncode == 0
    assert list(tmp_path.iterdir()) == []


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


READ_ONLY = """
import os, sys
from commands import verb
folder = sys.argv[1]

def refuse(event, given):
    writes = event in ("os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.truncate")
    writes = writes or (event == "open" and (given[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
    if writes and any(str(place).startswith(folder) for place in given[:2]):
        raise PermissionError(13, "Permission denied", str(given[0]))

sys.addaudithook(refuse)
for said in ("gnss_only:table", "each scenario has one method:table --findings", "position_rmse_m:rerun 1", "@:cite"):
    said, _, words = said.partition(":")
    name, *more = words.split()
    done = verb(name, folder, *more, cwd=os.path.dirname(folder))
    assert done.returncode == 0 and said in done.stdout + done.stderr, (words, done)
words = [f"results={os.path.dirname(folder)}", f"study={os.path.basename(folder)}", "dataset.duration_s=12", "seeds=3"]
done = verb("run", *words, "filter=gnss_only", "adaptation=none", cwd=os.path.dirname(folder))
assert done.returncode == 2 and "Results cannot be written to" in done.stderr, done
"""
"""A folder of mode 555, also for root."""


def test_commands_that_only_read_need_no_right_to_write_and_a_run_is_refused(tmp_path):
    study = tmp_path / "study"
    field = {"name": "field", "duration_s": 12}
    api.sweep(study, dataset=field, seeds=2, filter="gnss_only", adaptation="none", engine="filterpy")
    before = {path: path.stat().st_mtime_ns for path in study.rglob("*")}
    program = [sys.executable, "-c", READ_ONLY, str(study)]
    here = environment(PYTHONPATH=str(Path(__file__).parents[1]))
    done = subprocess.run(program, capture_output=True, text=True, env=here, check=False)

    assert done.returncode == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in study.rglob("*")} == before
