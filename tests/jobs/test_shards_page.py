"""The page's array of shards: each task has seeds of its own, and together they are one study."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import pages
from commands import environment, swept

FEW = "filter=gnss_only adaptation=none dataset.duration_s=12 figures=false study=paper"


@pytest.mark.slow
def test_the_tasks_of_the_array_are_one_study(tmp_path):
    """In small, and without SLURM, which says to each task which it is."""
    script = pages.files("cluster")["shards.sh"].replace("experiment=paper", FEW).replace("seeds=4", "seeds=2")
    (tmp_path / "shards.sh").write_text(script.replace("4 *", "2 *"), encoding="utf-8")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for task in ("1", "0"):
        variables = environment(PATH=path, SLURM_ARRAY_TASK_ID=task, SLURM_CPUS_PER_TASK="1")
        subprocess.run(["bash", "shards.sh"], cwd=tmp_path, env=variables, check=True, capture_output=True)
    (tmp_path / "whole").mkdir()
    swept(*FEW.split(), "seeds=4", cwd=tmp_path / "whole")

    shards, whole = ((folder / "results/paper/rows.csv").read_bytes() for folder in (tmp_path, tmp_path / "whole"))
    assert shards == whole
    assert whole.count(b"\n") == 5
