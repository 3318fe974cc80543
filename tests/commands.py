"""The command line as a person runs it, in a new process or in this one; other programs, and the scripts."""

import contextlib
import io
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from unittest.mock import patch

from jerkbench.cli import main

SHORT = ["dataset.duration_s=12", "seeds=1", "figures=false", "workers=1"]
"""A simulation that takes a fraction of a second."""

EXPERIMENTS = Path(__file__).parents[1] / "experiments"
PATIENCE_S = 900
"""A bound for what cannot fail by being slow, however much else the machine has to do."""


def environment(**more):
    """What a process sees; a PYTHONPATH comes before the one that there is, which may lead to the code under test."""
    if "PYTHONPATH" in more:
        more["PYTHONPATH"] = os.pathsep.join([more["PYTHONPATH"], os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    return {**os.environ, "COLUMNS": "200", **more}


def jerkbench(*words, cwd, **more):
    """Run `jerkbench WORDS`; returns the finished process with its output as text."""
    command = [sys.executable, "-m", "jerkbench", *words]
    done = subprocess.run(
        command, cwd=cwd, env=environment(**more), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def swept(*words, cwd, **more):
    """Run a sweep that has to go well, in this process; where it has to see another environment, in its own."""
    run = jerkbench if more else verb
    done = run("run", "-m", *SHORT, *words, cwd=cwd, **more)
    assert done.returncode == 0, done.stderr
    return done


def verb(*words, cwd):
    """Run `jerkbench WORDS` in this process; returns the same as `jerkbench`, two seconds of a processor sooner."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with (
        contextlib.chdir(cwd),
        patch.dict(os.environ, COLUMNS="200"),
        patch.object(sys, "argv", ["jerkbench"]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main([str(word) for word in words])
        except SystemExit as end:
            code = end.code or 0
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def standing_program(path):
    """Write a program whose estimate is that the vehicle does not move; returns its path."""
    path.write_text("""#!/bin/sh
awk -F, 'NR == 1 { print "t_s,east_m,north_m,up_m" } NR > 1 { print $1 ",0,0,0" }' "$1" > "$2"
""")
    path.chmod(0o755)
    return path


def experiment(script):
    """Import a script by its path below experiments/, and what lies beside it, as its own command line does."""
    path = EXPERIMENTS / script
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    return import_module(path.stem)


def children_of(pid):
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    ).stdout
    return [int(number) for number in listed.split()]


def alive(pid):
    """Whether a process runs; one that has ended and that nobody has waited for does not."""
    try:
        os.kill(pid, 0)
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except (ProcessLookupError, FileNotFoundError):
        return False
