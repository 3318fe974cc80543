"""`jerkbench data trace`, and a run with what it wrote."""

import pandas as pd


def test_a_trace_of_any_recording_can_be_replayed(tmp_path, typed):
    done = typed("data", "trace", "field", "own.parquet", "--set", "duration_s=30", "--licence", "MIT")
    assert done.returncode == 0, done.stderr
    assert "errors of 150 fixes of field against simulated truth" in done.stdout
    words = ["filter=baseline", "dataset.duration_s=20", "seeds=1", "study=replayed"]
    done = typed("run", *words, "disturbance=replayed_gnss", "disturbance.replayed_gnss.trace=own.parquet")
    assert done.returncode == 0, done.stderr
    assert "The errors of its fixes are replayed: those of field" in done.stdout
    assert len(pd.read_parquet(tmp_path / "own.parquet")) == 150


def test_what_cannot_be_done_is_a_sentence(tmp_path, typed):
    (tmp_path / "there.parquet").touch()
    for target, word in (("there.parquet", "there already"), ("a.csv", "suffix")):
        done = typed("data", "trace", "field", target)
        assert done.returncode == 2
        assert word in done.stderr
