"""Two processes that sweep into one folder of an object store: each cell is run once, none is missing."""

import subprocess
import sys
import time

import pytest

from commands import PATIENCE_S, SHORT, environment, swept
from jerkbench.places import place
from jerkbench.sweep.sharing import FOLDER

WORDS = ("filter=jerk,baseline", "adaptation=none,mtf", "noise.accel_mps2=0.1,0.2,0.3")
CELLS = 12
COUNTING = f"""
import os
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from jerkbench.clusters.local import Local


def counted(work, task):
    '''Note what is run, and wait at first until the other process has come as far: both are at work.'''
    with open(f"ran.{{os.getpid()}}", "a") as file:
        file.write(task.planned.key + "\\n")
    end = time.monotonic() + {PATIENCE_S}
    while len(list(Path().glob("ran.*"))) < 2:
        assert time.monotonic() < end, "the other process has run nothing"
        time.sleep(0.01)
    return work(task)


@dataclass(frozen=True)
class Counting:
    def run(self, order, workers):
        return Local().run(replace(order, work=partial(counted, order.work)), workers)
"""


def both_swept(folder, *words):
    """Sweep in two processes at once; returns what each has run."""
    (folder / "counting.py").write_text(COUNTING)
    command = [sys.executable, "-m", "jerkbench", "run", "-m", *SHORT, *words, "cluster._target_=counting.Counting"]
    seen = {"cwd": folder, "env": environment(PYTHONPATH=str(folder)), "stdout": subprocess.DEVNULL}
    told = folder / "told.txt"
    with told.open("w") as file:
        sweeps = [subprocess.Popen(command, stderr=file, **seen) for _ in range(2)]
        end = time.monotonic() + PATIENCE_S
        while None in (codes := [sweep.poll() for sweep in sweeps]) and not any(codes) and time.monotonic() < end:
            time.sleep(0.05)
        for sweep in sweeps:
            sweep.kill()
            sweep.wait()
    assert codes == [0, 0], told.read_text()
    return [file.read_text().split() for file in folder.glob("ran.*")]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("address", ["s3"], indirect=True)
def test_two_processes_share_a_sweep_into_a_bucket(address, tmp_path):
    swept(*WORDS, cwd=tmp_path)
    first, second = both_swept(tmp_path, *WORDS, f"results={address}")
    study = place(f"{address}/adhoc")

    assert first
    assert second
    assert len(first + second) == len(set(first + second)) == CELLS
    assert (study / "rows.csv").read_bytes() == (tmp_path / "results/adhoc/rows.csv").read_bytes()
    assert not list((study / FOLDER).glob("*"))
