"""The command line as a person runs it: in a process of its own, or, where that shows no more, in this one."""

import contextlib
import io
import os
import subprocess
import sys
from unittest.mock import patch

from jerkbench.cli import main

SHORT = ["dataset.duration_s=12", "seeds=1", "figures=false", "workers=1"]
"""A simulation that takes a fraction of a second."""

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
