"""`jerkbench score`: exported runs and trajectories of others."""

import csv
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


@pytest.mark.slow
def test_a_run_that_is_exported_and_scored_has_the_same_errors(folder):
    done = verb("score", "out/{seed}/estimate.tum", *SCENARIO, "study=duel", "name=mine", cwd=folder)
    assert done.returncode == 0, done.stderr
    rows = pd.read_csv(folder / "results" / "duel" / "rows.csv")
    ours, mine = (rows[rows["filter"] == name].reset_index() for name in ("baseline", "mine(external)"))

    assert list(mine["seed"]) == [0, 1]
    assert set(mine["status"]) == {"ok"}
    for metric in ("position_rmse_m", "position_rmse_up_m", "yaw_rmse_rad", "position_max_m"):
        np.testing.assert_allclose(mine[metric], ours[metric], rtol=1e-9)
    assert mine["velocity_rmse_mps"].isna().all()  # TUM has none
    assert re.search(r"mine\(external\): external estimates from .*SHA-256 [0-9a-f]{12}\), not aligned", done.stdout)


def test_it_stands_in_table_compare_and_report_and_another_file_is_another_row(folder):
    verb("score", "out/{seed}/estimate.tum", *SCENARIO, "study=duel", "name=mine", cwd=folder)
    assert "mine(external)" in verb("table", "results/duel", "--baseline", "filter=baseline", cwd=folder).stdout
    assert "mine(external)" in verb("table", "results/duel", "--findings", cwd=folder).stdout
    assert verb("compare", "results/duel", "results/duel", "--fail-above", "1", cwd=folder).returncode == 0
    assert verb("rerun", "results/duel", "3", cwd=folder).returncode == 0
    done = verb("report", "results/duel", "--scenarios", "0", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "mine(external)" in (folder / "results" / "duel" / "report.html").read_text()
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
        (["none_{seed}.tum", "dataset=field"], "No file matches none_{seed}.tum"),
        (["out/0/estimate.tum", "out/0/reference.tum", *SCENARIO], "must differ in one number"),
        (["out/0/estimate.tum", *SCENARIO, "seeds=2"], "has one file for 2 runs"),
        (["out/{seed}/estimate.tum", *SCENARIO, "seeds=3"], "The trajectory out/2/estimate.tum does not exist"),
        (["out/0/estimate.tum", "dataset=field", "dataset.duration_s=60"], "ends at 30"),
        (["out/0/estimate.tum", *SCENARIO, "burn_in_s=1"], "begins at 5.00 s, but errors are counted from 1.00 s on"),
    ],
)
def test_what_cannot_be_scored_is_a_sentence(folder, words, sentence):
    done = verb("score", *words, "study=wrong", cwd=folder)

    assert sentence in done.stderr + done.stdout


AWAY_M = np.array([3.0, 4.0, 0.0])


def places(t_s):
    return np.column_stack([10 * np.cos(t_s / 9), 10 * np.sin(t_s / 9), 0.1 * t_s])


def write(path, t_s, enu_m):
    np.savetxt(path, np.column_stack([t_s, enu_m, np.tile([0, 0, 0, 1], (len(t_s), 1))]), fmt="%.6f")


@pytest.fixture(params=[12.3, 1_715_695_200.0])
def start_s(request, tmp_path):
    t_s = np.arange(1000) / 10
    write(tmp_path / "ref.tum", request.param + t_s, places(t_s))
    late_s = np.arange(-2, 10_010) / 100  # on other stamps than the reference's
    write(tmp_path / "est.tum", request.param + late_s, places(late_s) + AWAY_M)
    return request.param


def rmse(done, folder):
    assert done.returncode == 0, done.stderr
    with (folder / "results" / "adhoc" / "rows.csv").open() as file:
        return [float(row["position_rmse_m"]) for row in csv.DictReader(file)]


def test_a_trajectory_is_scored_against_another_and_a_missing_one_is_a_sentence(tmp_path, start_s):
    done = verb("score", "est.tum", "--reference", "ref.tum", cwd=tmp_path)
    assert rmse(done, tmp_path) == [pytest.approx(5.0, abs=1e-3)]
    assert "ref.tum (see dataset.reference_independent); not independent of the measurements" in done.stdout
    done = verb("score", "est.tum", "--reference", "ref.tum", "dataset.reference_independent=true", cwd=tmp_path)
    assert "ref.tum (see dataset.reference_independent); independent of the measurements" in done.stdout
    done = verb("score", "est.tum", "--reference", "nowhere.tum", cwd=tmp_path)
    assert (done.returncode, "The reference nowhere.tum does not exist" in done.stderr) == (2, True)


def test_a_word_behind_the_reference_counts_and_a_csv_is_one(tmp_path, start_s):
    table = np.loadtxt(tmp_path / "ref.tum")[:, :4]
    np.savetxt(tmp_path / "ref.csv", table, delimiter=",", header="t,east_m,north_m,up_m", comments="", fmt="%.6f")
    words = [] if start_s > 1e8 else ["filter.clock=start", "filter.max_gap_s=1"]
    if not words:
        done = verb("score", "est.tum", "--reference", "ref.csv", "name=mine", cwd=tmp_path)
        assert rmse(done, tmp_path) == [pytest.approx(5.0, abs=1e-3)]
        assert "mine(external)" in done.stdout
    else:  # a table's first stamp is the recording's start
        table[:, 0] -= start_s
        write(tmp_path / "est.tum", table[:, 0], table[:, 1:] + AWAY_M)
        done = verb("score", "est.tum", "--reference", "ref.csv", *words, cwd=tmp_path)
        assert rmse(done, tmp_path) == [pytest.approx(5.0, abs=1e-3)]


def test_a_word_that_a_verb_does_not_take_is_still_refused(tmp_path):
    done = verb("list", "dataset", "--format", "json", "noise", cwd=tmp_path)

    assert "unrecognized arguments: noise" in done.stderr


def test_files_of_several_runs_on_one_recording_are_one_method_with_an_interval(tmp_path, start_s):
    t_s = start_s + np.arange(1000) / 10
    for run in range(1, 11):
        write(tmp_path / f"run{run}.tum", t_s, places(t_s - start_s) + np.array([0.1 * run, 0, 0]))
    words = ("first_seed=1", "seeds=10", "--reference", "ref.tum", "study=runs")
    done = verb("score", "run{seed}.tum", *words, cwd=tmp_path)
    rows = pd.read_csv(tmp_path / "results" / "runs" / "rows.csv")
    assert rows["position_rmse_m"].tolist() == pytest.approx([0.1 * run for run in range(1, 11)], abs=1e-3)
    assert rows["seed"].tolist() == list(range(1, 11))
    assert re.search(r"Position RMSE \(3-D\) \[m\] +0\.550 \[", done.stdout), done.stdout


@pytest.mark.parametrize(("shift_s", "refused"), [(18.0, True), (-18.0, True), (0.4, False)])
def test_another_clock_is_refused_and_a_lag_of_the_filter_is_its_error(tmp_path, start_s, shift_s, refused):
    t_s = np.arange(-200, 1200) / 10
    write(tmp_path / "est.tum", start_s + t_s + shift_s, places(t_s))
    done = verb("score", "est.tum", "--reference", "ref.tum", cwd=tmp_path)
    assert done.returncode == (2 if refused else 0), done.stdout
    if refused:
        assert f"shifted by {-shift_s:+.2f} s" in done.stderr
        assert "GPS time is 18 s ahead of UTC" in done.stderr
