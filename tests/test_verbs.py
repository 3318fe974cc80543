"""The verbs that read results, as a person uses them, over one small study."""

import numpy as np
import pandas as pd
import pytest

from commands import swept, verb
from jerkbench.jobs.store import Store
from stored_cells import put, store_cell


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verbs")
    words = ["filter=baseline,jerk", "adaptation=none,mtf", "disturbance=none,gnss_outage", "seeds=2"]
    swept(*words, "dataset.duration_s=60", cwd=folder)
    return folder / "results" / "adhoc"


def changed_copy(study, folder, factor, count=None):
    """Store ``count`` cells of ``study`` (default: all) below ``folder``, with other position errors; returns where."""
    for one in Store(study).read()[0][:count]:
        rows = one.rows.assign(position_rmse_m=one.rows["position_rmse_m"] * factor)
        store_cell(Store(folder), one.key, rows.to_dict("records"), one.metadata)
    return folder / "cells"


@pytest.mark.parametrize(("factor", "code", "difference"), [(1.5, 1, "0.33."), (1 + 1e-11, 0, "1e-11.")])
def test_rerun_reports_the_largest_relative_difference(study, tmp_path, factor, code, difference):
    done = verb("rerun", str(changed_copy(study, tmp_path, factor, count=1)), "1", cwd=tmp_path)
    assert done.returncode == code
    assert f"{code} of " in done.stdout
    assert done.stdout.strip().endswith(f"The largest relative difference is {difference}")


def test_a_metric_that_is_gone_is_seen(study, tmp_path):
    (stored, *_), _ = Store(study).read()
    rows = stored.rows.assign(position_of_old_m=1.0)
    store_cell(Store(tmp_path), stored.key, rows.to_dict("records"), stored.metadata)
    done = verb("rerun", str(tmp_path / "cells"), "1", cwd=tmp_path)
    assert done.returncode == 1
    assert "1 of " in done.stdout


def test_the_rmse_is_evos_over_the_exported_trajectories(study, tmp_path):
    pytest.importorskip("evo", reason="evo is not there; pip install 'jerkbench[anchors]'")
    from evo.core import metrics, sync
    from evo.tools import file_interface

    row = pd.read_csv(study / "rows.csv").iloc[5]
    done = verb("export", str(study), "6", "--tum", str(tmp_path / "out"), cwd=study)
    assert done.returncode == 0, done.stderr
    both = [file_interface.read_tum_trajectory_file(tmp_path / "out" / f"{n}.tum") for n in ("reference", "estimate")]
    error = metrics.APE(metrics.PoseRelation.translation_part)
    error.process_data(sync.associate_trajectories(*both))
    assert error.get_statistic(metrics.StatisticsType.rmse) == pytest.approx(row["position_rmse_m"], abs=1e-9, rel=1e-9)
    assert error.get_statistic(metrics.StatisticsType.max) == pytest.approx(row["position_max_m"], abs=1e-9)


def test_exported_quaternions_are_the_attitude(study, tmp_path):
    from scipy.spatial.transform import Rotation

    verb("export", str(study), "1", "--tum", str(tmp_path), cwd=study)
    poses = np.loadtxt(tmp_path / "estimate.tum")
    truth = np.loadtxt(tmp_path / "reference.tum")
    angle = (Rotation.from_quat(poses[:, 4:]).inv() * Rotation.from_quat(truth[:, 4:])).magnitude()
    row = pd.read_csv(study / "rows.csv").iloc[0]
    squares = sum(row[f"{name}_rmse_rad"] ** 2 for name in ("roll", "pitch", "yaw"))
    assert np.sqrt(np.mean(angle**2)) == pytest.approx(np.sqrt(squares), rel=0.02)  # the angles are small


def test_a_gate_does_not_pass_what_it_cannot_judge(study, tmp_path):
    one = changed_copy(study, tmp_path, 1.0, count=1)
    done = verb("compare", str(study), str(one), "--fail-above", "50", cwd=tmp_path)
    assert done.returncode == 4
    assert "7 of the 8 combinations of A cannot be compared: 7 because they are missing in B." in done.stdout
    assert verb("compare", str(study), str(one), cwd=tmp_path).returncode == 0
    (one / "damaged.parquet").write_bytes(b"PAR1")
    done = verb("compare", str(one), str(study), "--fail-above", "50", cwd=tmp_path)
    assert done.returncode == 4
    assert "Damaged files in A, which are left out: damaged." in done.stdout
    done = verb("compare", str(study), str(study), "--fail-above", "nan", cwd=tmp_path)
    assert done.returncode == 2
    assert "'nan' is not a valid percentage" in done.stderr


@pytest.mark.slow
def test_every_figure_of_a_study_is_drawn(study, tmp_path):
    done = verb("figures", str(study), "--out", str(tmp_path), "--scenarios", "1", "--pdf", cwd=study)
    assert done.returncode == 0, done.stderr
    kinds = {path.stem.rsplit("_", 1)[-1].lstrip("-") for path in tmp_path.glob("*none*.pdf")}
    named = ("errors", "trajectory", "three-sigma", "inclination", "consistency", "adapted-r")
    assert all(any(kind.endswith(name) for kind in kinds) for name in named)
    of_all = {f"{name}.png" for name in ("bars", "heat-map")}
    assert of_all <= {path.name for path in tmp_path.iterdir()}
    assert len(list(tmp_path.glob("*.png"))) == len(list(tmp_path.glob("*.pdf"))) == len(of_all) + len(named)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("rerun", "99"), "has no row 99; give a row from 1 to 16"),
        (("rerun", "zzz"), "'zzz' is not a valid number"),
        (("export", "1", "--tum", "rows.csv/x"), "rows.csv/x cannot be read or written: Not a directory;"),
        (("report", "--scenarios", "-1"), "'-1' is not a valid number; give an integer, 0 or more"),
        (("figures", "--scenarios", "two"), "There is no scenario 'two'."),
        (("figures", "--methods", "jrk"), "There is no method 'jrk'. Did you mean 'jerk'?"),
        (("figures", "--methods", "baseline+jerk"), "There is no method 'baseline+jerk'."),
        (("figures", "--seed", "99"), "The study has no seed 99; its seeds are from 0"),
        (("report", "--scenarios", "0", "--out", "rows.csv/x.html"), "rows.csv"),
        (("report", "--out", "."), "is a folder; give the name of a file"),
        (("table", "--metric", "status"), "There is no metric 'status'"),
        (("table", "--metric", "seed"), "There is no metric 'seed'"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(study, words, said):
    done = verb(words[0], str(study), *words[1:], cwd=study)
    assert done.returncode == 2
    assert said in done.stderr


def test_ten_findings_are_printed_and_all_on_request(tmp_path):
    for k, name in enumerate(("baseline", *(f"f{k}" for k in range(15)))):
        put(tmp_path / "many", f"{k:x}", 1.0 + k, filter=name, seeds=8)
    few, every = (
        verb("table", "many", "--findings", "--baseline", "filter=baseline", *more, cwd=tmp_path).stdout.splitlines()
        for more in ((), ("--all",))
    )
    assert len(every) == 15
    assert few == [*every[:10], "5 more comparisons; --findings --all prints all."]
