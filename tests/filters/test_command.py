"""Programs as filters: agreement of a C program with the baseline, and an error message for each kind of failure."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import jerkbench
from commands import PATIENCE_S, alive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.filters.trajectory import program_files, split_command
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts

EXAMPLES = Path(__file__).parents[2] / "examples" / "any_language"
SHORT = {"name": "field", "duration_s": 12.0, "stand_s": 2.0, "rut_times_s": (8.0,)}


@pytest.fixture(scope="module")
def baseline(tmp_path_factory):
    """The compiled example in C."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    program = tmp_path_factory.mktemp("built") / "baseline"
    subprocess.run(
        [compiler, "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(program), str(EXAMPLES / "baseline.c"), "-lm"],
        check=True,
    )
    return program


def rows_of(command, seeds=1, **parameters):
    return jerkbench.run(dataset=SHORT, filter={"name": "command", "command": command, **parameters}, seeds=seeds)


@pytest.mark.parametrize(
    ("package", "program", "attitude"),
    [
        ("vqf", "vqf_attitude.py tauAcc=30 restBiasEstEnabled=0", {"name": "vqf", "tau_acc_s": 30, "rest_bias": False}),
        ("ahrs", "ahrs_attitude.py filter=Madgwick gain=0.01", {"name": "madgwick", "gain_per_s": 0.01}),
    ],
)
def test_an_attitude_program_inside_the_baseline_agrees_with_the_plugin(package, program, attitude):
    """The estimates of the heading offset differ slightly: the plugins filter the yaw, the program the difference."""
    pytest.importorskip(package)
    script, *options = program.split()
    words = [sys.executable, EXAMPLES / "attitude_baseline.py", EXAMPLES / script, "{recording}", "{out}", *options]
    theirs = rows_of(" ".join([*map(str, words), "accel_mps2=0.5", "position=2", "velocity=3"]))
    method = {"filter": {"name": "baseline", "accel_mps2": 0.5}, "r_scale": {"position": 2.0, "velocity": 3.0}}
    ours = jerkbench.run(dataset=SHORT, attitude=attitude, seeds=1, **method)
    np.testing.assert_allclose(theirs["position_rmse_m"], ours["position_rmse_m"], rtol=1e-3)


def test_a_factor_graph_of_gtsam_navigates_as_the_error_state_filter():
    """The initial tilt differs: eskf15 computes the tilt from the force at rest, the program reads the attitude."""
    pytest.importorskip("gtsam")
    theirs = rows_of(f"{sys.executable} {EXAMPLES / 'gtsam_isam2.py'} {{recording}} {{out}}")
    ours = jerkbench.run(dataset=SHORT, filter={"name": "eskf15", "use_heading": False}, seeds=1)
    np.testing.assert_allclose(theirs["position_rmse_m"], ours["position_rmse_m"], rtol=0.1)


def test_a_program_in_c_agrees_with_the_baseline(baseline):
    ours = jerkbench.run(dataset=SHORT, filter="baseline", seeds=3)
    theirs = rows_of(f"{baseline} {{recording}} {{out}}", seeds=3)

    assert list(theirs["status"]) == ["ok"] * 3
    assert set(theirs["filter"]) == {"baseline(program)"}
    for metric in ("position_rmse_m", "velocity_rmse_mps", "position_max_m"):
        np.testing.assert_allclose(theirs[metric], ours[metric], rtol=1e-6)


def script(folder, text):
    path = folder / "mine.sh"
    path.write_text(text)
    return f"sh {path} {{recording}} {{out}} {{seed}}"


HEAD = 'echo t_s,east_m,north_m,up_m > "$2"\n'
EACH = 'awk -F, \'NR > 1 {{ print $1 ",{east},0,0" }}\' "$1" >> "$2"\n'


def test_arguments_change_the_result_and_the_label_changes_the_name(tmp_path):
    program = script(tmp_path, HEAD + EACH.format(east="'$4'"))
    first, second = (rows_of(f"{program} {east}", label=f"mine {east}") for east in ("0.0", "100.0"))

    assert [rows["filter"][0] for rows in (first, second)] == ["mine 0.0(program)", "mine 100.0(program)"]
    assert first["position_rmse_m"][0] != second["position_rmse_m"][0]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "echo first >&2; echo 'no such model' >&2; exit 3",
            "ended with exit code 3. Standard error: first | no such model",
        ),
        ("kill -SEGV $$", "was ended by SIGSEGV"),
        ("sleep 30", "took longer than 0.5 s (time_limit_s)"),
        ("exit 0", "exited with code 0 but did not write out.csv"),
        ("echo hello > $2", "out.csv"),
        (HEAD, "out.csv has no rows of data"),
        (HEAD + EACH.format(east="nan"), "out.csv, row 1, column east_m: 'nan' is not a finite number"),
        (HEAD + "echo 0.01,0,0,0 >> $2; echo 11.9,0,0,0 >> $2", "has no estimate between 0.01 and 11.90 s"),
        (HEAD + EACH.format(east="0") + "echo 0.5,0,0,0 >> $2", "the time is not later than in the row above"),
        ('echo t_s,x,y,z > "$2"; echo 1,2,3,4 >> "$2"', "There is no column 'east_m'"),
    ],
)
def test_each_kind_of_failure_is_a_failed_row_with_a_message(tmp_path, text, reason):
    row = rows_of(script(tmp_path, text), time_limit_s=0.5 if "0.5 s" in reason else PATIENCE_S).iloc[0]

    assert row["status"] == "failed"
    assert reason in row["reason"]
    assert "jerkbench_" not in row["reason"]  # the name of the temporary folder, which differs in each run


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it looks into /proc")
def test_child_processes_of_a_program_end_with_it(tmp_path):
    number = tmp_path / "number"
    program = script(tmp_path, f"sleep {PATIENCE_S} & echo $! > {number}; wait")
    for time_limit_s in (0.3, 3.0, 30.0, 300.0):  # the first limit is long enough unless the machine is busy
        rows_of(program, time_limit_s=time_limit_s)
        if number.exists() and number.read_text().strip():
            break

    deadline = time.monotonic() + PATIENCE_S / 2
    while alive(int(number.read_text())) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not alive(int(number.read_text()))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_ended_ends_its_program(tmp_path, number):
    begun = tmp_path / "begun"
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"  # it may be ignored here
        "from jerkbench.filters.trajectory import run_program; from pathlib import Path;"
        f"arguments = ['sh', '-c', 'echo $$ > {begun}; exec sleep {PATIENCE_S}'];"
        f"run_program(arguments, Path({str(tmp_path)!r}), {2 * PATIENCE_S})"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    while not (begun.exists() and begun.read_text().strip()):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(number)
    process.wait(PATIENCE_S)

    with pytest.raises(ProcessLookupError):
        os.kill(int(begun.read_text()), 0)


STARTED = """
import os, signal, subprocess, sys, time
from pathlib import Path
from jerkbench.filters.trajectory import run_program

class Interrupted(subprocess.Popen):
    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        Path("number").write_text(str(self.pid))
        os.kill(os.getpid(), int(sys.argv[1]))
        time.sleep(0.1)

signal.signal(signal.SIGINT, signal.default_int_handler)
subprocess.Popen = Interrupted
run_program(["sleep", sys.argv[2]], Path(), float(sys.argv[2]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_the_start_ends_the_program(tmp_path, number):
    arguments = [sys.executable, "-c", STARTED, str(int(number)), str(PATIENCE_S)]
    seen = {"cwd": tmp_path, "stderr": subprocess.PIPE, "text": True}
    done = subprocess.run(arguments, check=False, timeout=PATIENCE_S, **seen)

    assert done.returncode in (-signal.SIGINT, 128 + signal.SIGTERM), done.stderr
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "number").read_text()), 0)


def test_a_rebuilt_program_changes_the_key(tmp_path):
    def key():
        filter_part = {"name": "command", "command": command}
        single = {"dataset": SHORT, "attitude": None, "filter": filter_part, "adaptation": "none", "engine": "compiled"}
        return job_of_parts(single, [], None, Protocol()).key

    command = script(tmp_path, "exit 0")
    first, again = key(), key()
    script(tmp_path, "exit 0  # rebuilt")

    assert first == again
    assert key() != first


def test_a_program_receives_its_seed_but_no_reference(tmp_path):
    copy = f'cp -r "$(dirname "$1")" {tmp_path}/seen; echo "$3" > {tmp_path}/seed; exit 1'
    jerkbench.run(dataset=SHORT, filter={"name": "command", "command": script(tmp_path, copy)}, seeds=1, first_seed=7)

    assert (tmp_path / "seed").read_text() == "7\n"
    assert sorted(path.name for path in (tmp_path / "seen").iterdir()) == [
        "recording.csv",
        "recording.json",
        "stderr.txt",
        "stdout.txt",
    ]
    assert "reference_" not in (tmp_path / "seen" / "recording.csv").read_text()


def test_an_early_end_is_a_divergence(tmp_path):
    row = rows_of(script(tmp_path, HEAD + EACH.format(east="0").replace("NR > 1", "NR > 1 && $1 < 8"))).iloc[0]

    assert row["status"] == "diverged"
    assert "The trajectory ends at 7.99 s, but the reference ends at 12.00 s." in row["reason"]


def test_arguments_are_not_expanded_by_a_shell_and_files_among_them_are_of_the_command(tmp_path):
    arguments = split_command("./a '{recording}' \"two words\" $HOME;ls {out}", {"recording": "/x y", "out": "o"})
    assert arguments == ["./a", "/x y", "two words", "$HOME;ls", "o"]
    (tmp_path / "mine.py").write_text("")
    assert [path.name for path in program_files(f"sh {tmp_path / 'mine.py'} {{recording}}")] == ["sh", "mine.py"]
    with pytest.raises(RecordingError, match=r"The program \./nowhere was not found"):
        program_files("./nowhere {recording}")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"formats": ["cvs"]}, "There is no format of a recording 'cvs'. Did you mean 'csv'"),
        ({"formats": []}, "formats is empty"),
        ({"time_limit_s": 0.0}, "time_limit_s is 0.0"),
        ({"frame": "end"}, "There is no frame 'end'"),
    ],
)
def test_invalid_parameters_raise(given, message):
    with pytest.raises(PluginError, match=message):
        rows_of("sh {recording}", **given)
