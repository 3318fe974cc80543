"""`jerkbench tune` of attitude filters alone: their own ranges and switches, scored by the inclination."""

import json
from types import SimpleNamespace

import pytest
import yaml

from commands import verb
from jerkbench.campaign.runs import space_of
from jerkbench.campaign.search import objective_of
from jerkbench.campaign.split import Seeds, by_seeds
from jerkbench.errors import RecordingError
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts

SMALL = ["dataset.duration_s=20", "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "finalists=2", "workers=1"]


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """A folder in which two attitude filters were tuned, and what was said."""
    folder = tmp_path_factory.mktemp("tuned")
    words = ["filter=attitude_only", "attitude=mahony,mekf", "dataset=field", *SMALL, "trials=6", "figures=false"]
    done = verb("tune", "-m", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def cell_of(attitude, model="attitude_only"):
    single = {"dataset": "field", "attitude": attitude, "filter": model, "adaptation": "none", "engine": "compiled"}
    return job_of_parts(single, [], None, Protocol())


def test_several_attitude_filters_are_several_methods_with_equal_budgets_and_presets_that_run(tuned):
    folder, out = tuned
    assert "Objective: inclination" in out
    assert "Equal budgets: each of 2 methods tried 6 settings." in out
    record = json.loads((folder / "results/adhoc/tune/mahony/tuning.json").read_text())
    assert set(record["setting"]) == {"attitude.proportional_per_s", "attitude.integral_per_s2"}
    assert record["unseen"]["field(duration_s=20), none, mahony"]["tuned"] < 0
    place = tuned[0] / "results/adhoc/tune/mekf"
    setting = json.loads((place / "tuning.json").read_text())["setting"]
    preset = yaml.safe_load((place / "conf/attitude/mekf_tuned.yaml").read_text())
    words = ["--config-dir", str(place / "conf"), "experiment=mekf_tuned", "dataset=field", "dataset.duration_s=12"]
    done = verb("run", *words, "seeds=1", "figures=false", cwd=tuned[0])
    assert done.returncode == 0, done.stderr
    assert preset["bias"] is bool(setting["attitude.bias"])
    assert preset["accel_density"] == pytest.approx(setting["attitude.accel_density"])


def test_a_switch_is_on_in_half_of_its_range_and_only_attitude_filters_are_searched():
    (switch,) = (knob for knob in space_of(cell_of("mekf")).parameters if knob.field == "bias")
    assert [switch.typed(switch.value(share)) for share in (0.0, 0.49, 0.51, 1.0)] == [False, False, True, True]
    assert {knob.part for knob in space_of(cell_of("mekf", "baseline")).parameters} == {"filter", "r_scale"}
    (case,) = by_seeds([cell_of("mekf")], Seeds(1, 0, 1)).tune
    with pytest.raises(RecordingError, match="no reference attitude, so objective=inclination is not possible"):
        objective_of("inclination").require_reference(case, SimpleNamespace(reference=None))
