"""The choice of figures: few, all or none; the scenarios and methods that carry a finding."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs.store import Stored
from jerkbench.jobs.study import load_study, named_part
from jerkbench.report import Choice, figures_choice
from jerkbench.report.drawings import by_difference, telling_scenes
from jerkbench.report.study_figures import _chosen, ranked
from stored_cells import put

SCENES = {f"field, {disturbance}, tilt": disturbance for disturbance in ("none", "imu_bias", "outliers", "gnss_outage")}


def rows_of(factors, seeds=20):
    """Errors of each method: its factor in each scenario, times a spread of its own."""
    rng = np.random.default_rng(5)
    rows = []
    for (filter_name, adaptation), of_scenes in factors.items():
        for disturbance, factor in zip(SCENES.values(), of_scenes, strict=True):
            label = {"dataset": "field", "disturbance": disturbance, "attitude": "tilt", "noise": "default"}
            label |= {"filter": filter_name, "adaptation": adaptation, "replicate": "seed", "status": "ok"}
            errors_m = factor * np.exp(0.05 * rng.standard_normal(seeds))
            rows += [label | {"seed": seed, "position_rmse_m": error} for seed, error in enumerate(errors_m)]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("text", "choice"),
    [("few", "few"), ("all", "all"), ("none", "none"), ("True", "all"), ("false", "none"), (" All ", "all")],
)
def test_true_is_all_and_false_is_none(text, choice):
    assert figures_choice(text) is Choice(choice)


def test_another_word_is_refused_with_what_there_is():
    with pytest.raises(PluginError, match=r"'fwe'. Did you mean 'few'\? Available: all, few, none"):
        figures_choice("fwe")


def test_few_are_the_scenarios_where_a_finding_is_most_certain_with_its_methods():
    rows = rows_of(
        {
            ("baseline", "none"): (1.0, 1.0, 1.0, 1.0),
            ("jerk", "none"): (1.0, 0.1, 0.9, 1.0),  # against baseline: most in the second
            ("jerk", "mtf"): (1.0, 0.1, 0.3, 1.0),  # against none: most in the third
        }
    )
    scenes = telling_scenes(by_difference(rows, "position_rmse_m", list(SCENES)))
    assert {name: set(methods) for name, methods in scenes.items()} == {
        "field, imu_bias, tilt": {("baseline", "none"), ("jerk", "none")},
        "field, outliers, tilt": {("jerk", "none"), ("jerk", "mtf")},
    }


def test_without_a_finding_it_is_the_first_scenario_with_the_usual_methods():
    rows = rows_of({("baseline", "none"): (1.0,) * 4, ("jerk", "none"): (1.0,) * 4})
    assert telling_scenes(by_difference(rows, "position_rmse_m", list(SCENES))) == {"field, none, tilt": ()}
    assert telling_scenes(by_difference(rows, "position_rmse_m", [])) == {}


def test_the_largest_difference_comes_first_and_of_many_scenarios_those_with_the_largest_are_kept():
    """Over all scenarios jerk is hardly another than baseline: one scenario, the last, makes the difference."""
    rows = rows_of(
        {
            ("baseline", "none"): (1.0, 1.0, 1.0, 1.0),
            ("jerk", "none"): (0.8, 0.8, 1.0, 1 / 31),
            ("jerk", "mtf"): (0.4, 0.8, 1.0, 1 / 31),
        }
    )
    order = list(by_difference(rows, "position_rmse_m", list(SCENES)))

    assert order == ["field, gnss_outage, tilt", "field, none, tilt", "field, imu_bias, tilt", "field, outliers, tilt"]
    assert list(telling_scenes(by_difference(rows, "position_rmse_m", list(SCENES)))) == order[:3]


@dataclass(frozen=True)
class Mine:
    """A rule of the user's."""


@pytest.fixture
def mine(monkeypatch):
    monkeypatch.setitem(plugins._registry["adaptation"], "mine", Mine)


METHODS = ("mtf", "scalar_r", "sage_husa", "huber_r", "igg3", "none")


def cell_of(place, filter_name, adaptation, **labels):
    """A stored cell, the better the smaller its place."""
    rows = pd.DataFrame({"seed": [0], "status": ["ok"], "replicate": ["seed"], "position_rmse_m": [1.0 + place]})
    labels = {"filter": filter_name, "adaptation": adaptation, "noise": "default", **labels}
    spec = {kind: {"name": labels[kind].partition("(")[0]} for kind in ("filter", "adaptation")}
    return Stored(f"{place}", {"labels": labels, "spec": spec}, pa.Table.from_pandas(rows), list(rows.columns))


def drawn(cells, wanted=()):
    return list(_chosen(ranked(cells, "position_rmse_m"), wanted))


def test_the_users_own_method_is_drawn_however_bad_it_is(mine):
    others = [cell_of(place, "jerk", name) for place, name in enumerate(METHODS)]
    own = [cell_of(90, "jerk", "mine(x=1)"), cell_of(80, "baseline", "mine(x=2)"), cell_of(99, "command", "none")]

    assert "baseline + mine(x=2)" in drawn([*others, *own[:2]])
    assert drawn([*others, *own])[:3] == ["jerk + mtf", "baseline + mine(x=2)", "command + none"]
    assert len(drawn([*others, *own])) == 5
    few = drawn([*others, *own], wanted=[("jerk", "huber_r")])
    assert few == ["jerk + mtf", "baseline + mine(x=2)", "command + none", "jerk + huber_r"]


def test_what_is_wanted_by_name_is_drawn_whatever_its_number():
    others = [cell_of(place, "jerk", name) for place, name in enumerate(METHODS)]

    assert drawn(others, wanted=[("jerk", name) for name in METHODS]) == [f"jerk + {name}" for name in METHODS]


@pytest.fixture
def study(tmp_path):
    for place, cell in enumerate(
        [
            {"adaptation": "mtf"},
            {"adaptation": "mtf(window=4)", "conditions": {"spec": {"adaptation": {"name": "mtf", "window": 4}}}},
            {"filter": "baseline"},
            {"disturbance": "imu_bias(accel_mps2=0.1)+outliers"},
        ]
    ):
        put(tmp_path, f"{place}", 0.1, **cell)
    return load_study(tmp_path)


@pytest.mark.parametrize(
    ("names", "keys"),
    [
        (["mtf"], {"0", "1"}),
        (["mtf(window=4)"], {"1"}),
        (["jerk+mtf"], {"0", "1"}),
        (["jerk+none", "baseline"], {"2", "3"}),
    ],
)
def test_methods_are_named_with_their_parameters_or_without(study, names, keys):
    assert set(named_part(study, names, ("filter", "adaptation", "noise")).keys) == keys


@pytest.mark.parametrize("name", ["imu_bias+outliers", "imu_bias(accel_mps2=0.1)+outliers"])
def test_scenarios_are_named_with_their_parameters_or_without(study, name):
    assert set(named_part(study, [name], ("dataset", "disturbance", "attitude")).keys) == {"3"}


def test_a_name_that_nothing_has_is_told_with_those_that_there_are(study):
    with pytest.raises(JerkbenchError, match=r"There is no method 'mft'. Did you mean 'mtf'\? Available: baseline, "):
        named_part(study, ["mft"], ("filter", "adaptation", "noise"))
