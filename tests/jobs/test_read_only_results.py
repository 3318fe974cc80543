"""Results that may only be read: every verb that only reads answers."""

import subprocess
import sys

import pytest

from commands import environment
from jerkbench import api

READ_ONLY = """
import os, sys
folder = sys.argv[1]

def refuse(event, given):
    writes = event in ("os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.truncate")
    writes = writes or (event == "open" and (given[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
    if writes and any(str(place).startswith(folder) for place in given[:2]):
        raise PermissionError(13, "Permission denied", str(given[0]))

sys.addaudithook(refuse)
from jerkbench.cli import main
main(sys.argv[2:])
"""
"""A folder of mode 555, also for root."""

FIELD = {"name": "field", "duration_s": 12}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("read_only") / "study"
    parts = {"filter": "gnss_only", "adaptation": "none", "engine": "filterpy"}
    api.sweep(folder, dataset=FIELD, seeds=2, **parts)
    return folder


@pytest.mark.parametrize(
    ("words", "said"),
    [(["table"], "gnss_only"), (["table", "--findings"], ""), (["rerun", "1"], "position_rmse_m"), (["cite"], "@")],
    ids=lambda of: " ".join(of) if isinstance(of, list) else None,
)
def test_a_verb_that_only_reads_needs_no_right_to_write(study, words, said):
    before = {path: path.stat().st_mtime_ns for path in study.rglob("*")}
    program = [sys.executable, "-c", READ_ONLY, str(study), words[0], str(study), *words[1:]]
    done = subprocess.run(program, capture_output=True, text=True, env=environment(), check=False)

    assert done.returncode == 0, done.stderr
    assert said in done.stdout
    assert {path: path.stat().st_mtime_ns for path in study.rglob("*")} == before


def test_a_run_there_is_refused_in_a_sentence(study):
    words = ["run", f"results={study.parent}", f"study={study.name}", "dataset.duration_s=12", "seeds=3"]
    program = [sys.executable, "-c", READ_ONLY, str(study), *words, "filter=gnss_only", "adaptation=none"]
    done = subprocess.run(program, capture_output=True, text=True, env=environment(), cwd=study.parent, check=False)

    assert done.returncode == 2
    assert "Results cannot be written to" in done.stderr
    assert "Traceback" not in done.stderr
