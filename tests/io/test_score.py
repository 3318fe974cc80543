"""`jerkbench score` as a person uses it: a run of ours, exported and scored, is the same run."""

import re

import numpy as np
import pandas as pd
import pytest

from commands import swept, verb
from jerkbench.jobs.study import load_study

SCENARIO = ["dataset=field", "dataset.duration_s=30", "disturbance=outliers"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of ours over two seeds, and their trajectories."""
    folder = tmp_path_factory.mktemp("score")
    swept(*SCENARIO, "filter=baseline", "seeds=2", "study=duel", cwd=folder)
    for seed in (0, 1):
        done = verb("export", "results/duel", str(seed + 1), "--tum", f"out/{seed}", cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def rows_of(folder):
    rows = pd.read_csv(folder / "results" / "duel" / "rows.csv")
    return {name: group.reset_index(drop=True) for name, group in rows.groupby("filter")}


@pytest.mark.slow
def test_a_run_that_is_exported_and_scored_has_the_same_errors(folder):
    done = verb("score", "out/{seed}/estimate.tum", *SCENARIO, "study=duel", "name=mine", cwd=folder)
    assert done.returncode == 0, done.stderr
    rows = rows_of(folder)
    ours, mine = rows["baseline"], rows["mine(external)"]

    assert list(mine["seed"]) == [0, 1]
    assert set(mine["status"]) == {"ok"}
    for metric in ("position_rmse_m", "position_rmse_up_m", "yaw_rmse_rad", "position_max_m"):
        np.testing.assert_allclose(mine[metric], ours[metric], rtol=1e-9)
    assert mine["velocity_rmse_mps"].isna().all()  # TUM has none
    assert re.search(
        r"mine\(external\): estimates from elsewhere, .*SHA-256 [0-9a-f]{12}\) and not aligned", done.stdout
    )


def test_it_stands_in_table_compare_and_report(folder):
    verb("score", "out/{seed}/estimate.tum", *SCENARIO, "study=duel", "name=mine", cwd=folder)

    assert "mine(external)" in verb("table", "results/duel", "--baseline", "filter=baseline", cwd=folder).stdout
    assert "mine(external)" in verb("table", "results/duel", "--findings", cwd=folder).stdout
    assert verb("compare", "results/duel", "results/duel", "--fail-above", "1", cwd=folder).returncode == 0
    assert verb("rerun", "results/duel", "3", cwd=folder).returncode == 0
    done = verb("report", "results/duel", "--scenarios", "0", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "mine(external)" in (folder / "results" / "duel" / "report.html").read_text()


def test_another_file_of_the_same_name_is_another_row(folder):
    verb("score", "out/0/estimate.tum", *SCENARIO, "study=keys", "name=mine", cwd=folder)
    first = set(load_study(folder / "results" / "keys").keys)
    (folder / "changed.tum").write_text((folder / "out" / "0" / "estimate.tum").read_text() + "\n")
    verb("score", "changed.tum", *SCENARIO, "study=keys", "name=mine", cwd=folder)

    assert set(load_study(folder / "results" / "keys").keys).isdisjoint(first)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["dataset=field"], "No trajectory is given"),
        (["out/{seed}/estimate.tum", "dataset=fild"], "Did you mean 'field'"),
        (["none_{seed}.tum", "dataset=field"], "There is no trajectory none_{seed}.tum"),
        (["out/0/estimate.tum", "out/0/reference.tum", *SCENARIO], "must differ in one number"),
        (["out/0/estimate.tum", *SCENARIO, "seeds=2"], "has one file for 2 runs"),
        (["out/{seed}/estimate.tum", *SCENARIO, "seeds=3"], "There is no trajectory out/2/estimate.tum"),
        (["out/0/estimate.tum", "dataset=field", "dataset.duration_s=60"], "ends at 30"),
        (["out/0/estimate.tum", *SCENARIO, "burn_in_s=1"], "begins at 5.00 s, and errors count from 1.00 s on"),
    ],
)
def test_what_cannot_be_scored_is_a_sentence(folder, words, sentence):
    done = verb("score", *words, "study=wrong", cwd=folder)

    assert sentence in done.stderr + done.stdout
