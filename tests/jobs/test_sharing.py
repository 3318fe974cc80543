"""Several processes write to one study, and no row is missing or counted twice."""

import subprocess
import sys
import threading

import pandas as pd
import pytest

from commands import PATIENCE_S, environment
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import job_rows
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import load_study
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
def test_four_processes_with_seeds_of_their_own_make_one_study(tmp_path):
    words = [
        "filter=gnss_only",
        "disturbance=none,outliers",
        "dataset.duration_s=30",
        "study=one",
        "workers=1",
        "seeds=3",
    ]
    command = [sys.executable, "-m", "jerkbench", "run", "-m", *words]
    parts = [
        subprocess.Popen(
            [*command, f"first_seed={3 * part}"], cwd=tmp_path, env=environment(), stdout=subprocess.DEVNULL
        )
        for part in range(4)
    ]
    assert [part.wait(PATIENCE_S) for part in parts] == [0] * 4

    rows = load_study(tmp_path / "results" / "one").rows
    assert sorted(zip(rows["disturbance"], rows["seed"], strict=True)) == [
        (name, seed) for name in ("none", "outliers") for seed in range(12)
    ]
