"""A reference that is not perfect: its floor under the RMSE, its bad epochs, and differences that it cannot tell."""

import numpy as np
import pandas as pd
import pytest

from commands import verb
from jerkbench.datasets.table import Tables
from jerkbench.errors import PluginError
from jerkbench.evaluation.judgement import Verdict
from jerkbench.evaluation.metrics.position import ReferenceFloor
from jerkbench.report.columns import FACTORS
from jerkbench.report.comparisons import compare_runs, family_note, runs_by_combination

N = 20_000


@pytest.fixture
def folder(tmp_path):
    """Places that are exact, and a reference whose errors are drawn from the sigmas that it states."""
    draw, t_s = np.random.default_rng(1), np.arange(N) / 10
    exact = np.column_stack([t_s, np.sin(t_s), 0 * t_s])
    sigma = np.where(np.arange(N)[:, None] % 4 == 0, [0.3, 0.4, 1.2], [0.03, 0.04, 0.12])
    sigma[7] = 50.0
    for name, places in (("fix", exact), ("truth", exact + draw.normal(size=(N, 3)) * sigma)):
        columns = dict(
            zip(("t", "east_m", "north_m", "up_m", "se", "sn", "su"), [t_s, *places.T, *sigma.T], strict=True)
        )
        pd.DataFrame(columns).to_csv(tmp_path / f"{name}.csv", index=False)
        np.savetxt(tmp_path / f"{name}.tum", np.column_stack([t_s, places, np.tile([0, 0, 0, 1], (N, 1))]))
    return tmp_path


def table(folder, **more):
    parameters = {"imu_file": "", "position_file": "fix.csv", "position_columns": ("east_m", "north_m", "up_m")}
    parameters |= {
        "position_frame": "enu",
        "reference_file": "truth.csv",
        "reference_position": ("east_m", "north_m", "up_m"),
    }
    return Tables(str(folder), **parameters, **more)


def test_the_rmse_of_a_perfect_estimate_is_the_floor(folder):
    loaded = table(folder, reference_sigma=("se", "sn", "su"), reference_worst_m=5.0)
    words = [f"dataset.{key}={value}" for key, value in (("reference_sigma", "[se,sn,su]"), ("reference_worst_m", 5.0))]
    done = verb("score", "fix.tum", "--reference", "truth.csv", "filter.clock=start", *words, cwd=folder)
    rows = pd.read_csv(folder / "results" / "adhoc" / "rows.csv")

    assert done.returncode == 0, done.stderr
    assert rows["position_rmse_m"][0] == pytest.approx(rows["reference_floor_m"][0], rel=0.03)
    assert rows["reference_floor_m"][0] == pytest.approx(1.3 * np.sqrt((1 + 3 * 0.01) / 4), rel=0.01)
    assert f"1 of {N} epochs of the reference are too inaccurate and not scored." in loaded.load().notes
    assert "smaller differences are not tested" in done.stdout


def test_a_number_stands_for_all_epochs_and_without_it_there_is_no_floor(folder):
    one = table(folder, reference_sigma_m=0.1).load()
    np.testing.assert_array_equal(one.reference.sigma_m, np.full((N, 3), 0.1))
    assert table(folder).load().reference.sigma_m is None
    assert one.reference.scored.all()
    with pytest.raises(PluginError, match="reference_sigma has 2 entries"):
        table(folder, reference_sigma=("se", "sn"))

    class Run:
        index = np.arange(N)

    recording = table(folder).load()
    assert np.isnan(ReferenceFloor().evaluate(Run(), recording, np.ones(N, dtype=bool))["reference_floor_m"])


@pytest.mark.parametrize(("floor_m", "verdict"), [(0.001, Verdict.BETTER), (0.05, Verdict.UNDECIDED)])
def test_a_difference_below_the_floor_gets_no_verdict(floor_m, verdict):
    draw = np.random.default_rng(2)
    rows = [
        {**dict.fromkeys(FACTORS, "x"), "filter": name, "seed": seed, "replicate": "seed", "status": "ok",
         "position_rmse_m": mean + 0.002 * draw.normal(), "reference_floor_m": floor_m}
        for name, mean in (("good", 0.10), ("plain", 0.12))
        for seed in range(30)
    ]  # fmt: skip
    good, plain = runs_by_combination(pd.DataFrame(rows), "position_rmse_m").values()
    compared = compare_runs([(good, plain)])

    assert compared[0].verdict is verdict
    assert ("because the difference is less than the sigma of the reference" in family_note(compared)) == (
        verdict is Verdict.UNDECIDED
    )
