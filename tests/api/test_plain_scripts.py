"""Studies of several processes, in a script that has no `if __name__ == "__main__":`."""

import subprocess
import sys

import pytest

from commands import PATIENCE_S, environment
from jerkbench.jobs.study import load_study

SWEEP = """
from jerkbench import api
print("begun", flush=True)
short = {{"name": "field", "duration_s": 12}}
study = api.sweep("study", dataset=short, filter=[{filters}], seeds=1, workers={workers})
print(study.rows["status"].tolist())
"""

REPORT = "print(api.report(study).is_file())"

FILTER = """
import jerkbench
from dataclasses import dataclass
from jerkbench.filters.kinematic import Jerk

@jerkbench.register("filter", "mine")
@dataclass(frozen=True)
class Mine(Jerk):
    '''A filter of the user's.'''
"""


def script(folder, *parts):
    """Run a script; returns the finished process."""
    (folder / "script.py").write_text("\n".join(parts), encoding="utf-8")
    command = [sys.executable, "script.py"]
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


@pytest.mark.parametrize(
    ("before", "filters", "workers"),
    [
        ("", ("baseline", "jerk"), 2),
        ("import filters_of_mine", ("mine", "jerk"), 2),
        pytest.param(FILTER, ("mine", "jerk"), 1, marks=pytest.mark.slow),
    ],
    ids=["without plugins", "a filter of a module beside it", "a filter of its own, in one process"],
)
def test_a_script_without_a_guard_runs_once_and_its_report_is_drawn(tmp_path, before, filters, workers):
    (tmp_path / "filters_of_mine.py").write_text(FILTER, encoding="utf-8")
    done = script(tmp_path, before, SWEEP.format(filters=", ".join(map(repr, filters)), workers=workers), REPORT)

    assert (done.returncode, done.stdout.split("\n")) == (0, ["begun", "['ok', 'ok']", "True", ""]), done.stderr
    assert "no figures" not in done.stderr
    assert set(load_study(tmp_path / "study").rows["filter"]) == set(filters)


def test_more_workers_are_refused_for_a_filter_of_the_script_itself(tmp_path):
    done = script(tmp_path, FILTER, SWEEP.format(filters="'mine', 'jerk'", workers=2))

    assert done.returncode == 1
    assert done.stderr.endswith(
        "Mine is defined in the script itself, where other processes cannot find it: give workers=1, or move it into a "
        "module that the script imports.\n"
    )
    assert not (tmp_path / "study").exists()
