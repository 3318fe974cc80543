"""Workers and the scheduler of Dask that die, and Ctrl-C: no finished run is computed again."""

import contextlib
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from commands import environment, swept
from jerkbench.jobs.store import Store

CELLS = 100
PLAIN = "engine=filterpy"  # so slow that a sweep is not over before anything can happen to it
WORDS = [f"noise.accel_mps2=range(0.1,{CELLS / 10 + 0.1:g},0.1)", PLAIN, "seeds=2", "dataset.duration_s=15"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed"),
]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    swept(*WORDS, cwd=folder)
    return rows(folder)


def rows(folder):
    return (folder / "results/adhoc/rows.csv").read_bytes()


def done_already(sweep):
    return int(re.search(rf"(\d+) of {CELLS} combinations are already complete", sweep.stderr)[1])


def started(folder, *words):
    """Start a sweep in a group of its own; returns as soon as a cell is complete, and others are not."""
    command = [sys.executable, "-m", "jerkbench", "run", "-m", *WORDS, *words, "figures=false", "workers=2"]
    sweep = subprocess.Popen(
        command,
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while sweep.poll() is None and not Store(folder / "results/adhoc").read(shown={})[0]:
        time.sleep(0.05)
    assert sweep.poll() is None, sweep.communicate()
    return sweep


def test_a_worker_that_is_killed_costs_nothing(expected, tmp_path):
    with dask_site(tmp_path) as (address, _, workers):
        sweep = started(tmp_path, "cluster=dask", f"cluster.address={address}")
        workers[0].kill()
        _, told = sweep.communicate(timeout=300)

    assert sweep.returncode == 0, told
    assert rows(tmp_path) == expected


def test_a_scheduler_that_is_killed_ends_the_sweep_in_a_sentence_and_a_table(expected, tmp_path):
    with dask_site(tmp_path) as (address, scheduler, _):
        sweep = started(tmp_path, "cluster=dask", f"cluster.address={address}")
        scheduler.kill()
        table, told = sweep.communicate(timeout=300)

    assert sweep.returncode == 1, told
    done = (rows(tmp_path).count(b"\n") - 1) // 2
    assert "the sweep was stopped: The Dask scheduler tcp://127.0.0.1" in told
    assert "Traceback" not in told
    assert "Position RMSE" in table
    assert done_already(swept(*WORDS, cwd=tmp_path)) >= done  # a worker may have stored more, after the sweep's end
    assert rows(tmp_path) == expected


def test_after_ctrl_c_the_table_is_printed_and_the_same_command_goes_on(expected, tmp_path):
    sweep = started(tmp_path, "cluster=dask")
    os.killpg(sweep.pid, signal.SIGINT)
    table, told = sweep.communicate(timeout=300)

    assert sweep.returncode == 130, told
    assert "Interrupted. Finished runs are stored" in told
    assert "Traceback" not in told
    assert "Position RMSE" in table
    assert done_already(swept(*WORDS, "cluster=dask", cwd=tmp_path)) > 0
    assert rows(tmp_path) == expected


@contextlib.contextmanager
def dask_site(folder, workers=2):
    """Start them; yields the scheduler's address, its process, and the workers' processes."""
    with contextlib.ExitStack() as stack:
        address_file = Path(folder) / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder, "env": environment()}

        def start(*words):
            process = subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], **quiet)
            stack.callback(_end, process)
            return process

        common = ("--scheduler-file", str(address_file), "--no-dashboard")
        scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", *common)
        alone = ("--nthreads", "1", "--no-nanny", "--death-timeout", "120", "--local-directory", folder)
        several = [start("worker", *alone, *common) for _ in range(workers)]
        yield _address(address_file, scheduler), scheduler, several


def _address(file, scheduler):
    while scheduler.poll() is None:
        with contextlib.suppress(FileNotFoundError, ValueError):
            return json.loads(file.read_text())["address"]
        time.sleep(0.05)
    raise AssertionError("The scheduler has ended.")


def _end(process):
    process.kill()
    process.wait()
