"""The commands of each study's README, typed in their small version, from the first to the last.

The small version stands above the commands, a line of more words for each: <!-- small: ... -->; "-": as it is.
"""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from commands import environment, verb

ROOT = Path(__file__).parents[1]
STUDIES = sorted(path.parent.name for path in (ROOT / "experiments").glob("*/README.md"))
RECORDINGS = {
    "drive": "rtklib_drive_0708",
    "replayed": "rtklib_drive_0708",
    **dict.fromkeys(("attitude", "journeys", "vehicles"), ""),
}
"""Folder of a study's recording, where it is not called as the study is."""

BLOCK = re.compile(r"<!-- small:\n(.*?)-->\n```sh\n(.*?)```", flags=re.DOTALL)


def commands(study):
    """Every command of the study's README with its more words."""
    text = (ROOT / "experiments" / study / "README.md").read_text(encoding="utf-8")
    blocks = BLOCK.findall(text)
    assert len(blocks) == text.count("```sh\n"), f"experiments/{study}/README.md has commands without <!-- small: -->"
    for more, block in blocks:
        yield from zip(block.splitlines(), more.splitlines(), strict=True)


def words(command, more):
    return [*shlex.split(command), *([] if more == "-" else shlex.split(more))]


def run_python(script, *arguments, cwd):
    command = [sys.executable, str(ROOT / script), *arguments]
    done = subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES)
def test_the_commands_of_a_study_go_well(study, tmp_path, request):
    if study == "attitude":
        pytest.importorskip("vqf")
    folder = ""
    for command, more in commands(study):
        if "FOLDER" in command:
            data = request.getfixturevalue("shared_folder") / "data" / RECORDINGS.get(study, study)
            folder = str(data)
        program, *arguments = words(command.replace("FOLDER", folder), more)
        if program == "python":
            assert len(run_python(*arguments, cwd=tmp_path)) > 100
        else:
            alone = ["--workers", "1"] if arguments[0] == "audit" else ["workers=1"]
            done = verb(*arguments, *alone, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
