"""A SLURM of one node on this machine, in a folder of its own: munged, slurmctld and slurmd."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

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
    """Start one; yields the environment in which its commands find it.

    Raises:
        NoSlurmError: a program is missing, we are not root, or the node does not come up.
    """
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
