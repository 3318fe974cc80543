"""R of a stream that no recording has is not searched."""

import numpy as np
import pytest

from commands import verb


@pytest.mark.parametrize(("velocity", "knobs"), [("", 1), (",1.0,0,0", 2)])
def test_r_of_velocities_is_tuned_where_there_are_velocities(tmp_path, velocity, knobs):
    t_s = np.arange(400) / 10
    rows = [f"{t},{1.0 * t:.3f},{0.3 * np.sin(t):.3f},0{velocity}" for t in t_s]
    names = "t,east_m,north_m,up_m" + (",ve,vn,vu" if velocity else "")
    (tmp_path / "log.csv").write_text("\n".join([names, *rows]))
    assert verb("data", "inspect", "log.csv", "--preset", "mine.yaml", cwd=tmp_path).returncode == 0
    words = ["dataset=mine", "filter=constant_velocity", "trials=2", "finalists=1", "objective=likelihood", "workers=1"]
    done = verb("tune", "--config-dir", ".", *words, "split=time", "figures=none", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert done.stdout.count("| r_scale.") == knobs
