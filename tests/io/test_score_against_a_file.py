"""`jerkbench score est.tum --reference ref.tum`: no word says which recording it is."""

import csv

import numpy as np
import pytest

from commands import verb

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


def test_a_trajectory_is_scored_against_another_without_a_word(tmp_path, start_s):
    done = verb("score", "est.tum", "--reference", "ref.tum", cwd=tmp_path)

    assert rmse(done, tmp_path) == [pytest.approx(5.0, abs=1e-3)]
    assert "ref.tum, as it is given" in done.stdout


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


def test_a_reference_that_is_not_there_is_a_sentence(tmp_path, start_s):
    done = verb("score", "est.tum", "--reference", "nowhere.tum", cwd=tmp_path)

    assert (done.returncode, "There is no reference nowhere.tum" in done.stderr) == (2, True)


def test_a_word_that_a_verb_does_not_take_is_still_refused(tmp_path):
    done = verb("list", "dataset", "--format", "json", "noise", cwd=tmp_path)

    assert "unrecognized arguments: noise" in done.stderr
