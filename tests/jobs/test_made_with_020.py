"""A study that version 0.2.0 made (its commit is in the manifest): it is read, run again and gone on with."""

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from commands import verb
from jerkbench.jobs.study import load_study, replay_differences, stored_row

MADE = Path(__file__).parent / "made_with_020"
MEANS = ["0.0287", "0.0284", "0.0297", "0.0295", "1.03", "0.0284", "1.11", "0.0295"]
"""As 0.2.0 printed them: without and with outliers, of the baseline and of jerk, without and with mtf."""


@pytest.fixture
def study(tmp_path):
    return shutil.copytree(MADE, tmp_path / "results" / "v020")


def answer(*words, cwd):
    done = verb(*words, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_its_rows_are_those_of_the_csv_that_was_written_then(study):
    rows, then = load_study(study).rows, pd.read_csv(MADE / "rows.csv")

    assert list(rows) == list(then)
    assert set(then["noise"]) == {"own"}
    then["noise"] = "default"  # its name of today
    rows, then = (frame.drop(columns="reason") for frame in (rows, then))  # empty: text here, NaN there
    pd.testing.assert_frame_equal(rows, then, rtol=1e-14, atol=0, check_dtype=False)


def test_its_table_has_the_numbers_that_it_had_and_its_findings_their_ratios(study, tmp_path):
    assert re.findall(r"([\d.]+)\s\[", answer("table", study, cwd=tmp_path)) == MEANS
    rmse_m = pd.read_csv(MADE / "rows.csv").query("disturbance == 'outliers'").set_index("filter")["position_rmse_m"]
    none, mtf = (rmse_m["baseline"].iloc[seeds] for seeds in (slice(3), slice(3, 6)))
    ratio = (mtf.prod() / none.prod()) ** (1 / 3)
    found = answer("table", study, "--findings", cwd=tmp_path)
    assert f"between baseline+mtf and baseline+none on outliers: {ratio:.4f} times" in found
    assert answer("compare", study, study, cwd=tmp_path).count("identical") == len(MEANS)


def test_a_row_of_it_runs_again_to_the_same_numbers(study, tmp_path):
    told = verb("rerun", study, "15", cwd=tmp_path)  # to the bit only on a processor of the same kind
    assert "numbers differ." in told.stdout, told.stderr
    for name, was, now in replay_differences(stored_row(study, 15)):
        assert now == pytest.approx(was, rel=1e-9, abs=0, nan_ok=True), name


@pytest.mark.slow
def test_a_sweep_goes_on_in_its_folder_and_says_what_is_left_out(study, tmp_path):
    words = ["dataset.duration_s=40", "disturbance=none,outliers", "filter=jerk", "adaptation=mtf", "seeds=3"]
    printed = answer("run", "-m", *words, "figures=false", "workers=1", "study=v020", cwd=tmp_path)

    assert re.findall(r"([\d.]+)\s\[", printed) == [MEANS[3], MEANS[7]]
    assert "2 results of the same names with other settings, code or data are left out." in printed
