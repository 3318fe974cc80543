"""The commands of docs/any_language.md on shorter drives; a script replaces the program KF-GINS."""

import importlib.util
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

import pages
from bag_maker import ROS2, odometry
from commands import environment, verb

ROOT = Path(__file__).parents[1]
DRIVE = ["dataset.duration_s=60"]
SHORT = {"run": [*DRIVE, "seeds=1", "workers=1"], "data": DRIVE, "score": DRIVE}
STAND_IN = """\
#!{python}
import sys
import numpy as np

folder = sys.argv[1].rpartition("/")[0]
imu, gnss = np.loadtxt(folder + "/imu.txt"), np.loadtxt(folder + "/gnss.txt")
t = imu[imu[:, 0] >= gnss[0, 0], 0]
place = [np.interp(t, gnss[:, 0], gnss[:, k]) for k in (1, 2, 3)]
zero = np.zeros_like(t)
np.savetxt(folder + "/KF_GINS_Navresult.nav", np.column_stack([zero, t, *place, *[zero] * 6]), fmt="%.10f")
"""
"""Fixes on a straight line, in the form of KF-GINS."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A copy of the examples, after everything on the page was typed."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler on this machine")
    folder = tmp_path_factory.mktemp("any") / "language"
    shutil.copytree(ROOT / "examples" / "any_language", folder)
    (folder / "KF-GINS").write_text(STAND_IN.format(python=sys.executable))
    (folder / "KF-GINS").chmod(0o755)
    for line in pages.lines("any_language"):
        typed(line, folder)
    return folder


def publish(folder):
    """In the place of a ROS node: the trajectories of the program in C, as an odometry in the bag of each seed."""
    start_ns = 1_715_695_200 * 10**9  # of `field`
    for seed in range(3):
        rows = np.loadtxt(folder / f"mine_{seed}.csv", delimiter=",", skiprows=1)
        stamps_ns = [start_ns + round(t * 1e9) for t in rows[:, 0]]
        made = [
            odometry(ROS2, ns, row[1:4], (0.0, 0.0, 0.0, 1.0), row[4:7], frame="map")
            for ns, row in zip(stamps_ns, rows, strict=True)
        ]
        with Writer(folder / f"filtered_{seed}", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            place = writer.add_connection("/odometry/filtered", "nav_msgs/msg/Odometry", typestore=ROS2)
            for ns, (msgtype, message) in zip(stamps_ns, made, strict=True):
                writer.write(place, ns, ROS2.serialize_cdr(message, msgtype))
        (written,) = (folder / f"filtered_{seed}").glob("*.mcap")
        written.rename(folder / f"filtered_{seed}" / f"filtered_{seed}_0.mcap")


def typed(line, folder):
    words = shlex.split(line)
    if "filter.topic" in line:
        publish(folder)
    if words[0] != "jerkbench":
        subprocess.run(["sh", "-c", line], cwd=folder, env=environment(), check=True, timeout=100)
        return
    short = SHORT.get(words[1], [])
    words = [word.replace("python ", f"{sys.executable} ") for word in words]
    if "python-ins" in line:
        if importlib.util.find_spec("pyins") is None:
            return
        words = [word for word in words if "disturbance=" not in word]
        short = [*SHORT["run"][1:], "dataset.duration_s=12", "study=pyins"]  # it takes as long as the drive
    options = words.index("--format") if "--format" in words else len(words)
    done = verb(*words[1:options], *short, *words[options:], cwd=folder)
    assert done.returncode == 0, (line, done.stderr, done.stdout)


@pytest.fixture
def rows_of(folder):
    return lambda study: pd.read_csv(folder / "results" / study / "rows.csv")


@pytest.mark.slow
def test_every_program_stands_in_one_table_and_is_scored_as_it_is_run(rows_of):
    rows = rows_of("languages")
    counts = rows[rows["status"] == "ok"].groupby("filter")["disturbance"].nunique()
    assert dict(counts) == dict.fromkeys(["gnss_only", "baseline", "jerk", "C(program)", "KF-GINS(program)"], 3)
    errors = rows.set_index(["filter", "disturbance"])["position_rmse_m"]
    pd.testing.assert_series_equal(errors["C(program)"], errors["baseline"], rtol=1e-5)
    scored, run = rows_of("scored"), rows_of("languages")
    assert list(scored["filter"].unique()) == ["mine(external)", "robot_localization(external)"]
    assert list(scored["seed"]) == [0, 1, 2, 0, 1, 2]
    first = run[(run["filter"] == "C(program)") & (run["disturbance"] == "gnss_outage")]
    assert scored["position_rmse_m"][0] == pytest.approx(float(first["position_rmse_m"].iloc[0]), rel=1e-9)
    for metric in ("position_rmse_m", "velocity_rmse_mps"):
        errors = scored.pivot_table(metric, index="seed", columns="filter")
        np.testing.assert_allclose(errors["robot_localization(external)"], errors["mine(external)"], rtol=1e-6)


@pytest.mark.slow
def test_python_ins_navigates(rows_of):
    pytest.importorskip("pyins", reason="python-ins is not there; pip install 'jerkbench[anchors]'")
    rows = rows_of("pyins")

    assert list(rows["filter"]) == ["python-ins(program)"]
    assert rows["position_rmse_m"][0] < 0.1
    assert rows["yaw_rmse_rad"][0] < 0.05
