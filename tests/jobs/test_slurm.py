"""Sweeps through a real SLURM: with a job that is killed half-way, and by the scripts of the page on clusters."""

import importlib.util
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from slurm_site import NoSlurmError, slurm

import pages
from commands import environment, swept

PAGE = pages.text("cluster")
CELLS = 200
WORDS = [f"noise.accel_mps2=range(0.1,{CELLS / 10 + 0.1:g},0.1)", "filter=jerk", "seeds=2", "dataset.duration_s=12"]
FEW = ["filter=jerk,baseline", "adaptation=none,mtf", "seeds=1", "dataset.duration_s=12", "figures=false"]
HERE = ["cluster.memory=1GB", "cluster.interface=lo", "cluster.logs=logs"]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site():
    if importlib.util.find_spec("dask_jobqueue") is None:
        pytest.skip("dask-jobqueue is not installed")
    try:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        with slurm() as variables:
            yield {**environment(), **variables, "PATH": path}
    except NoSlurmError as reason:
        pytest.skip(str(reason))


def jobs(site):
    done = subprocess.run(
        ["squeue", "-h", "-t", "RUNNING", "-o", "%i"], env=site, capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout.split()


def rows(folder):
    return (folder / "results/adhoc/rows.csv").read_bytes()


def local_rows(folder, *words):
    """Rows of the same sweep in the own pool."""
    (folder / "local").mkdir()
    swept(*words, cwd=folder / "local")
    return rows(folder / "local")


def test_a_job_that_is_cancelled_costs_nothing(site, tmp_path):
    command = [sys.executable, "-m", "jerkbench", "run", "-m", *WORDS, "cluster=slurm", *HERE, "figures=false"]
    sweep = subprocess.Popen(command, cwd=tmp_path, env=site, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    cells = tmp_path / "results/adhoc/cells"
    while sweep.poll() is None and not any(cells.glob("*.parquet")):
        time.sleep(0.02)
    assert sweep.poll() is None, sweep.communicate()
    subprocess.run(["scancel", jobs(site)[0]], env=site, check=True, timeout=60)
    _, told = sweep.communicate(timeout=900)

    assert sweep.returncode == 0, told
    assert "failed" not in told
    assert rows(tmp_path) == local_rows(tmp_path, *WORDS)
    assert rows(tmp_path).count(b"\n") == 2 * CELLS + 1


def test_the_script_of_the_page_goes_well(site, tmp_path):
    """In small: fewer cells, jobs and memory."""
    script = re.search(r"<!-- file: head.sh -->\n```sh\n(.*?)```", PAGE, flags=re.DOTALL)[1]
    script = re.sub(r"cluster\.(jobs|memory)=\S+", "", script).replace("--mem=2G", "--mem=1G")
    (tmp_path / "head.sh").write_text(script.replace("experiment=paper", " ".join([*FEW, "cluster.jobs=1", *HERE])))
    done = subprocess.run(
        ["sbatch", "--wait", "head.sh"],
        cwd=tmp_path,
        env=site,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )

    assert done.returncode == 0, [path.read_text() for path in tmp_path.glob("slurm-*.out")]
    assert rows(tmp_path) == local_rows(tmp_path, *FEW)
