"""The action: its steps, run as a machine would run them, on a package that is there."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from commands import environment, verb

ROOT = Path(__file__).parents[1]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
QUICK = "-m filter=baseline adaptation=none,mtf dataset.duration_s=8 seeds=2 engine=filterpy workers=1"


@pytest.fixture
def machine(tmp_path):
    """A folder with a program `jerkbench`, and a function that runs a step of the action there."""
    program = tmp_path / "bin" / "jerkbench"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m jerkbench "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)

    def run(name, **inputs):
        (step,) = (step for step in ACTION["runs"]["steps"] if step.get("name") == name)
        given = {
            key: re.sub(r"\${{ inputs\.([\w-]+) }}", lambda m: inputs[m[1]], text) for key, text in step["env"].items()
        }
        here = environment(**given, GITHUB_STEP_SUMMARY=str(tmp_path / "summary.md"))
        here["PATH"] = f"{program.parent}{os.pathsep}{here['PATH']}"
        return subprocess.run(
            ["bash", "-e", "-c", step["run"]], cwd=tmp_path, env=here, capture_output=True, check=False
        )

    return run


def test_every_input_of_a_step_is_declared():
    text = (ROOT / "action.yml").read_text(encoding="utf-8")

    assert set(re.findall(r"inputs\.([\w-]+)", text)) == set(ACTION["inputs"])


@pytest.mark.slow
def test_it_passes_what_is_the_same_and_fails_what_is_worse(machine, tmp_path):
    accepted = verb("run", *QUICK.split(), "results=benchmarks", "study=accepted", cwd=tmp_path)
    assert accepted.returncode == 0, accepted.stderr

    assert machine("run", run=QUICK).returncode == 0
    limits = {"baseline": "benchmarks/accepted", "fail-above": "3"}
    assert machine("compare", **limits).returncode == 0
    assert "identical" in (tmp_path / "summary.md").read_text(encoding="utf-8")

    stricter = machine("compare", **{**limits, "fail-above": "-50"})
    assert stricter.returncode == 3
    assert b"2 of 2 combinations fail (allowed: -50 %)." in stricter.stdout
