"""The exit codes of `jerkbench run`: a diverged run is a result, a failed one, or one whose rows are gone, is not."""

import shutil
from pathlib import Path

from commands import SHORT, verb
from jerkbench.jobs import study


def test_a_single_run_that_diverged_is_a_result(tmp_path):
    done = verb("run", *SHORT, "divergence_limit_m=1e-9", cwd=tmp_path)
    assert "diverged" in done.stdout
    assert done.returncode == 0


def test_a_sweep_with_a_diverged_run_is_one_too_and_one_with_a_failed_run_is_not(tmp_path, monkeypatch):
    done = verb("run", "-m", *SHORT, "divergence_limit_m=1e-9", "adaptation=none,mtf", cwd=tmp_path)
    assert done.returncode == 0
    monkeypatch.setattr("jerkbench.jobs.rows.run_seed", lambda *_: 1 / 0)
    monkeypatch.setattr("jerkbench.jobs.rows.streams", lambda _: False)
    assert verb("run", "-m", *SHORT, "study=failing", "adaptation=none,mtf", cwd=tmp_path).returncode == 1


def test_an_input_at_fault_is_another(tmp_path):
    assert verb("run", *SHORT, "seeds=0", cwd=tmp_path).returncode == 2


def test_a_sweep_whose_files_vanish_meanwhile_says_so(tmp_path, monkeypatch):
    write = study.write_study

    def vanishing(written):
        table = write(written)
        shutil.rmtree(Path(written.folder) / "cells")
        return table

    monkeypatch.setattr(study, "write_study", vanishing)
    done = verb("run", "-m", *SHORT, "adaptation=none,mtf", cwd=tmp_path)
    assert done.returncode == 1
    assert "2 of 2 cells are not in results/adhoc/cells, although they have run" in done.stderr


def test_a_sweep_names_skips_and_counts_a_recording_that_cannot_be_used(tmp_path):
    table = "t,e,n,u\n" + "".join(f"{0.2 * k:.1f},{k},0,0\n" for k in range(100))
    for name in ("good", "short"):
        (tmp_path / name).mkdir()
    (tmp_path / "good" / "fix.csv").write_text(table)
    words = [
        *("dataset=table", "dataset.position_file=fix.csv", "dataset.position_time=t", "dataset.epoch=none"),
        *("dataset.position_columns=[e,n,u]", "dataset.position_frame=enu", "dataset.imu_file=''", "figures=none"),
        *("disturbance=withhold", "workers=1", "filter=gnss_only,constant_velocity"),
    ]
    done = verb("run", "-m", *words, "dataset.folder=short,good,nowhere", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    left_out = [line for line in done.stderr.splitlines() if line.startswith("Left out 2 combinations: the recording ")]
    assert len(left_out) == 2
    assert "There is no file short/fix.csv" in left_out[0]
    assert "There is no folder nowhere" in left_out[1]
    assert (tmp_path / "results" / "adhoc" / "rows.csv").read_text().count(",ok,") == 8

    done = verb("run", "-m", *words, "dataset.folder=short,nowhere", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
