import pytest

from bag_maker import Drive
from commands import verb


@pytest.mark.slow
def test_a_run_says_that_the_fusion_is_no_independent_reference_and_what_was_repaired(tmp_path):
    drive = Drive(duration_s=10.0)
    drive.messages("/fixposition/poiimu")[7].linear_acceleration.x = float("nan")
    drive.write(tmp_path / "a.bag")
    words = ["dataset=fixposition", "dataset.file=a.bag", "filter=gnss_only", "figures=false", "burn_in_s=1"]
    done = verb("run", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Position RMSE (3-D) [m]" in done.stdout
    said = " ".join(done.stdout.split())
    assert "sensor's own fusion (/fixposition/odometry_ecef); not independent of the measurements" in said
    assert "Velocity and reference are of one topic, /fixposition/odometry_ecef: not independent of each other" in said
    assert "1 of 500 rows with a NaN or infinite linear acceleration" in said
    table = (tmp_path / "results" / "adhoc" / "table.md").read_text()
    assert "not independent of the measurements" in table
    assert "1 of 500 rows with a NaN or infinite linear acceleration" in table
