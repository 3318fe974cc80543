"""The program of a stored cell runs where it is asked for, and nowhere else."""

import pytest

from commands import verb
from jerkbench import api
from jerkbench.errors import PluginError
from jerkbench.filters.trajectory import Command
from jerkbench.jobs.job import replaced
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import program_of, runnable, stored_row
from stored_cells import put

PROGRAM = """#!/bin/sh
echo ran >> "$(dirname "$0")/ran"
awk -F, 'NR == 1 { print "t_s,east_m,north_m,up_m" } NR > 1 { print $1 ",0,0,0" }' "$1" > "$2"
"""
SWEEP = ("dataset.duration_s=8", "seeds=2", "metrics=[position_rmse]", "report=false", "workers=1", "study=theirs")


@pytest.fixture(scope="module")
def theirs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("theirs")
    program = folder / "stands"
    program.write_text(PROGRAM)
    program.chmod(0o755)
    for words in (["filter=command", f"filter.command='{program} {{recording}} {{out}}'"], ["filter=baseline"]):
        done = verb("run", *words, *SWEEP, cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def ran(folder):
    return (folder / "ran").read_text().count("ran")


LEFT_OUT = (0, "1 combination runs a program and is not run again. The tables contain the stored rows")
REFUSED = (2, "Programs run only with --run-programs")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["report", "results/theirs"], LEFT_OUT),
        (["figures", "results/theirs"], LEFT_OUT),
        (["rerun", "results/theirs", "1"], REFUSED),
        (["export", "results/theirs", "1", "--tum", "tum"], REFUSED),
    ],
)
def test_looking_at_results_runs_no_program(theirs, words, expected):
    before, (code, said) = ran(theirs), expected
    done = verb(*words, cwd=theirs)

    assert (done.returncode, ran(theirs)) == (code, before), done.stderr
    assert said in done.stderr


def test_a_program_runs_where_it_is_asked_for_and_python_says_what_it_leaves_out(theirs, capfd):
    before = ran(theirs)
    api.report(theirs / "results" / "theirs", scenarios=0, figures="none")
    assert "1 combination runs a program" in capfd.readouterr().err
    assert ran(theirs) == before
    before = ran(theirs)
    done = verb("rerun", "results/theirs", "1", "--run-programs", cwd=theirs)
    assert done.returncode == 0, done.stderr
    assert ran(theirs) == before + 1


@pytest.mark.parametrize("command", ["", "true"])
def test_noise_cannot_name_a_program(tmp_path, command):
    made = tmp_path / "made"
    spec = {"filter": {"name": "command", "command": command}, "noise": {"command": f"/usr/bin/touch {made}"}}
    put(tmp_path, "c" * 20, 0.1, spec=spec)
    (stored,), _ = Store(tmp_path).read()

    assert runnable([stored], run_programs=False) == []
    assert replaced(Command, spec["noise"]) == {}


def test_a_long_command_is_not_cut_in_silence():
    told = program_of({"filter": {"name": "command", "command": f"python3 ok.py{' ' * 300}; evil {'x' * 300}"}})
    assert told.startswith("python3 ok.py ; evil x")
    assert " characters ...] xxx" in told


def test_a_missing_plugin_is_named_with_its_package(tmp_path):
    put(
        tmp_path,
        "e" * 20,
        0.1,
        spec={"attitude": {"name": "tilt"}, "adaptation": {"name": "wary"}},
        packages={"wary": "1.2"},
    )

    with pytest.raises(
        PluginError, match=r"There is no adaptation 'wary'.* packages that are not installed: wary==1\.2"
    ):
        stored_row(tmp_path, 1)
