"""Sweeps through a SLURM of one node on this machine: a job is cancelled, and the scripts of the page."""

import contextlib
import importlib.util
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

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


PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scancel", "sinfo")
START_S = 60.0
CONFIGURATION = """\
ClusterName=test
SlurmctldHost={name}(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={controller}
SlurmdPort={daemon}
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
NodeName={name} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000
PartitionName=main Nodes={name} Default=YES MaxTime=INFINITE State=UP
"""


class NoSlurmError(Exception):
    """Why there is none here."""


@contextlib.contextmanager
def slurm():
    """Start one; yields the environment in which its commands find it."""
    missing = [program for program in PROGRAMS if shutil.which(program) is None]
    if missing:
        raise NoSlurmError(f"{', '.join(missing)} are not installed (Debian: slurm-wlm, munge)")
    if os.geteuid() != 0:
        raise NoSlurmError("slurmd and munged run as root here")
    folder = Path(tempfile.mkdtemp(prefix="slurm-"))
    folder.chmod(0o755)  # munged refuses a socket that others cannot reach
    try:
        yield _started(folder)
    finally:
        for name in ("slurmd", "slurmctld", "munged"):
            _end(folder / f"{name}.pid")
        shutil.rmtree(folder, ignore_errors=True)


def _started(folder):
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    for name in ("state", "spool"):
        (folder / name).mkdir()
    name = socket.gethostname().partition(".")[0]
    ports = {"controller": _free_port(), "daemon": _free_port()}
    (folder / "slurm.conf").write_text(CONFIGURATION.format(name=name, folder=folder, **ports))
    environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}
    files = {"key-file": key, "socket": folder / "munge.socket", "pid-file": folder / "munged.pid"}
    files |= {"log-file": folder / "munged.log", "seed-file": folder / "munge.seed"}
    _start(["munged", "--force", *(f"--{option}={path}" for option, path in files.items())], environment)
    _start(["slurmctld", "-f", folder / "slurm.conf"], environment)
    _start(["slurmd", "-f", folder / "slurm.conf"], environment)
    _wait_until_idle(environment)
    return environment


def _start(command, environment):
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=START_S)
    if done.returncode:
        raise NoSlurmError(f"{command[0]} does not start: {done.stderr.strip()}")


def _wait_until_idle(environment):
    until = time.monotonic() + START_S
    while time.monotonic() < until:
        done = subprocess.run(
            ["sinfo", "-h", "-o", "%T"], env=environment, capture_output=True, text=True, check=False, timeout=START_S
        )
        if done.stdout.strip() == "idle":
            return
        time.sleep(0.2)
    raise NoSlurmError(f"the node does not come up: {done.stdout.strip()} {done.stderr.strip()}")


def _free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _end(number):
    """End a daemon by its number, and wait until it has."""
    try:
        pid = int(number.read_text())
        os.kill(pid, signal.SIGTERM)
        until = time.monotonic() + 10
        while time.monotonic() < until:
            os.kill(pid, 0)
            time.sleep(0.05)
        os.kill(pid, signal.SIGKILL)
    except (FileNotFoundError, ProcessLookupError, ValueError):
        return
