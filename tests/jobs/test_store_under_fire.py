"""The store where things go wrong: killed processes, two at once, damage, no room, a plugin that is another now."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from commands import PATIENCE_S, SHORT, alive, children_of, environment, swept
from jerkbench.jobs.store import Store
from stored_cells import keys_of

CELLS = ["filter=baseline,jerk,gnss_only", "disturbance=none,imu_bias", "noise.accel_mps2=0.1,0.2"]
WORDS = ["run", "-m", *SHORT[:-1]]


def rows_of(folder):
    rows = pd.read_csv(folder / "results" / "adhoc" / "rows.csv")
    return rows.sort_values(list(rows.columns[:7]), ignore_index=True)


def start(folder, *more):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "jerkbench", *WORDS, *more], cwd=folder, env=environment(), **quiet)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    swept(*CELLS, cwd=folder)
    return rows_of(folder), len(stored(folder))


def stored(folder):
    return {path.name for path in (folder / "results" / "adhoc" / "cells").glob("*.parquet")}


@pytest.mark.slow
def test_after_any_kills_the_rows_are_those_of_an_undisturbed_sweep(undisturbed, tmp_path):
    """A kill between and within cells leaves whole cells or none (benchmarks/kills.py does it fifty times)."""
    rows, cells = undisturbed
    moments = np.random.default_rng(1)
    while len(before := stored(tmp_path)) < cells / 2:
        process = start(tmp_path, *CELLS, "workers=2")
        while process.poll() is None and stored(tmp_path) == before:
            time.sleep(0.005)
        time.sleep(moments.uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert stored(tmp_path) > before
        _, broken = Store(tmp_path / "results" / "adhoc").read()
        assert broken == []
    swept(*CELLS, cwd=tmp_path)
    pd.testing.assert_frame_equal(rows_of(tmp_path), rows, check_exact=True)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it looks into /proc")
def test_workers_end_with_a_parent_that_was_killed(tmp_path):
    process = start(tmp_path, *CELLS, "workers=2", "dataset.duration_s=100", "seeds=20")
    workers = []
    while process.poll() is None and len(workers) < 3:  # two, and multiprocessing's resource tracker
        time.sleep(0.1)
        workers = children_of(process.pid)
    time.sleep(1.5)
    process.send_signal(signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + PATIENCE_S
    while any(map(alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert len(workers) >= 2
    assert not any(map(alive, workers))


@pytest.mark.slow
def test_two_processes_in_one_folder_give_the_rows_of_one(undisturbed, tmp_path):
    both = [start(tmp_path, *CELLS, "workers=1"), start(tmp_path, *CELLS, "workers=1", "notes=[two]")]
    assert [process.wait(timeout=PATIENCE_S) for process in both] == [0, 0]
    pd.testing.assert_frame_equal(rows_of(tmp_path), undisturbed[0], check_exact=True)
    left = {path.name for path in (tmp_path / "results" / "adhoc" / "cells").iterdir() if path.suffix != ".parquet"}
    assert left == set()


def limited(blocks, *words, cwd):
    """Run the command line where no file can be larger than ``blocks`` KiB: as on a disk that is full."""
    command = f'ulimit -f {blocks}; exec "$0" -m jerkbench "$@"'
    return subprocess.run(
        ["bash", "-c", command, sys.executable, *words],
        cwd=cwd,
        env=environment(NUMBA_DISABLE_JIT="1"),  # compiled code has no room either, and would be compiled each time
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_where_there_is_no_room_nothing_finished_is_lost_and_it_is_said(tmp_path):
    words = [*WORDS, *CELLS, "disturbance=none,imu_bias,gnss_outage", "workers=1"]
    cells = tmp_path / "results" / "adhoc" / "cells"
    for blocks, sentence in (
        (4, "Results cannot be written"),  # not even the sweep's own configuration
        (16, "the sweep was stopped, because a result cannot be stored"),
        (40, "the tables cannot be written"),  # a cell has room, the manifest has not
    ):
        full = limited(blocks, *words, cwd=tmp_path)
        assert full.returncode in (1, 2)
        assert sentence in full.stderr
        assert "Traceback" not in full.stderr
        assert not [path for path in cells.glob("*") if path.suffix != ".parquet"]
    assert len(keys_of(cells.parent)) == 15
    again = swept(*CELLS, "disturbance=none,imu_bias,gnss_outage", cwd=tmp_path)
    assert "15 of 15 combinations are already complete" in again.stderr
    assert len(rows_of(tmp_path)) == 15


PLUGIN = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Doubt:
    '''Multiplies R by a constant.'''

    def memory_size(self):
        return 0

    def adapt(self, innovation, HPHt, R, rows, memory):
        return {factor} * R
"""


@pytest.mark.slow
def test_a_plugin_that_is_another_now_is_run_again_and_that_is_said(tmp_path):
    metadata = tmp_path / "doubting-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: doubting\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[jerkbench.adaptation]\ndoubt = doubting:Doubt\n")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    rmse = []
    for factor in (2.0, 9.0):
        (tmp_path / "doubting.py").write_text(PLUGIN.format(factor=factor))
        done = swept("adaptation=doubt", cwd=tmp_path, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1")
        rmse.append(pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv")["position_rmse_m"].tolist())
    assert len(rmse[1]) == 1
    assert rmse[0] != rmse[1]
    assert "1 result of the same name with other settings, code or data is left out." in done.stdout
