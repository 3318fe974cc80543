"""A log without yaw, or with a mistake: the sentence comes before the run; the first stands under the table too."""

import numpy as np
import pytest

SENTENCE = "table: nothing shows yaw"


@pytest.fixture
def log(tmp_path):
    """Half a minute at rest under noisy fixes."""
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 30.0, 0.05)
    sensed = np.column_stack([t_s, rng.normal(np.eye(6)[2] * 9.81, 0.05, (len(t_s), 6))])
    fixes = np.column_stack([np.arange(1.0, 29.0), rng.normal(0.0, 1.0, (28, 3))])
    for name, rows, header in (("imu", sensed, "t,ax,ay,az,gx,gy,gz"), ("fixes", fixes, "t,e,n,u")):
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=header, comments="")
    return {"folder": tmp_path, "position_file": "fixes.csv", "position_columns": "[e,n,u]", "position_frame": "enu"}


@pytest.mark.parametrize("sweep", [["-m", "workers=1", "report=false"], []])
def test_it_is_said_before_the_run_and_under_the_table(typed, log, sweep):
    chosen = [f"dataset.{name}={value}" for name, value in log.items()]
    done = typed("run", *sweep, "dataset=table", *chosen, "filter=gnss_only", "figures=false")

    assert done.returncode == 0, done.stderr
    assert SENTENCE in done.stderr
    assert SENTENCE in " ".join(done.stdout.split())


def test_inspection_says_it_too_with_every_set_counted(typed, log):
    chosen = [word for name, value in log.items() if name != "folder" for word in ("--set", f"{name}={value}")]
    done = typed("data", "inspect", str(log["folder"]), "--dataset", "table", *chosen)

    assert done.returncode == 0, done.stderr
    assert "position       28 rows" in done.stdout
    assert "yaw: nothing shows yaw" in done.stdout


def test_a_mistake_is_told_before_the_run_with_its_remedy(typed, log):
    chosen = [f"dataset.{name}={value}" for name, value in (log | {"accel_unit": "g"}).items()]
    done = typed("run", "dataset=table", *chosen, "filter=gnss_only", "figures=false")

    assert "table: The accelerometer is 9.8 times too large" in done.stderr
    assert "accel_unit=m/s2" in done.stderr
