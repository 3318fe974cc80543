"""The choice of figures, and their titles and file names."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import run_seed
from jerkbench.jobs.store import Stored
from jerkbench.jobs.study import load_study, named_part
from jerkbench.report import Choice, figures_choice
from jerkbench.report.plots.studies import by_difference
from jerkbench.report.study_figures import _selected, file_stem, ranked, with_title
from made_jobs import SPEC
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
    return list(_selected(ranked(cells, "position_rmse_m"), wanted))


def test_the_users_own_method_is_drawn_however_bad_and_what_is_wanted_whatever_its_number(mine):
    others = [cell_of(place, "jerk", name) for place, name in enumerate(METHODS)]
    own = [cell_of(90, "jerk", "mine(x=1)"), cell_of(80, "baseline", "mine(x=2)"), cell_of(99, "command", "none")]
    assert "baseline + mine(x=2)" in drawn([*others, *own[:2]])
    assert drawn([*others, *own])[:4] == ["jerk + mtf", "baseline + mine(x=2)", "jerk + mine(x=1)", "command + none"]
    assert len(drawn([*others, *own])) == 6
    few = drawn([*others, *own], wanted=[("jerk", "huber_r")])
    assert few == ["jerk + mtf", "baseline + mine(x=2)", "jerk + mine(x=1)", "command + none", "jerk + huber_r"]
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


FIELD = {"name": "field", "duration_s": 20.0}
DRIVE = {"name": "rtklib", "folder": "anywhere"}


def cell(dataset, *disturbances):
    return build({**SPEC, "dataset": dataset, "disturbance": list(disturbances)}, Protocol(seeds=3, first_seed=7))


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (cell(FIELD, {"name": "none"}), "a, seed 7"),
        (cell(FIELD, {"name": "imu_bias"}), "a, imu_bias, seed 7"),
        (cell(DRIVE, {"name": "none"}), "a"),
        (cell(DRIVE, {"name": "withhold", "every": 4}), "a, withhold, phase 7"),
    ],
)
def test_a_title_says_data_set_disturbance_and_seed(one, said, make_short):
    assert with_title(make_short("a"), one, 7).name == said


@pytest.fixture(scope="module")
def make_short():
    recording, _ = run_seed(cell(FIELD, {"name": "none"}), 7)
    return lambda name: replace(recording, name=name)


def test_names_of_files_are_short_and_the_same_for_the_same_labels():
    plain = cell(FIELD, {"name": "imu_bias"}).labels
    long = plain._replace(dataset=f"table({', '.join(f'column_{k}=name_{k}' for k in range(40))})")

    assert file_stem(plain) == "field-imu_bias-tilt-baseline-none-default"
    assert file_stem(long) == file_stem(long)
    assert file_stem(long).startswith("table-imu_bias-tilt-baseline-none-default-")
    assert file_stem(long) != file_stem(long._replace(dataset=long.dataset.replace("name_3", "name_4")))
    assert len(file_stem(plain._replace(disturbance="+".join(["gnss_outage"] * 30)))) < 120
