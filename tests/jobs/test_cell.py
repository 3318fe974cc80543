"""A cell from plain data: what it runs, what its key depends on, what it refuses."""

import pytest

from jerkbench.errors import PluginError
from jerkbench.jobs import key as keys_of_cells
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.names import refusal
from jerkbench.jobs.plan import planned
from jerkbench.report.labels import joined
from made_jobs import SPEC, with_data


def cell(protocol=None, **changed):
    return build({**SPEC, **changed}, protocol or Protocol())


def test_noise_that_is_set_replaces_the_filters_own_and_the_rest_is_left_alone():
    noise = {"accel_mps2": 0.7, "jerk_mps3_per_sqrt_s": 3.0, "bias_mps2_per_sqrt_s": None}

    assert cell(noise=noise).method.filter.accel_mps2 == 0.7
    assert cell(noise=noise, filter={"name": "jerk"}).method.filter.jerk_mps3_per_sqrt_s == 3.0
    assert cell(noise=noise, filter={"name": "jerk"}).method.filter.initial_jerk_mps3 == 20.0
    assert cell(noise=noise, filter={"name": "gnss_only"}).spec["filter"] == {"name": "gnss_only"}


def test_a_random_cell_has_its_seeds_a_deterministic_one_its_phases_and_a_label_its_disturbances():
    drive = {"name": "rtklib", "folder": "anywhere"}
    assert list(cell(Protocol(seeds=3, first_seed=7)).draws) == [7, 8, 9]
    assert list(cell(dataset=drive).draws) == [0]
    assert list(cell(dataset=drive, disturbance=[{"name": "withhold", "every": 4}]).draws) == [0, 1, 2, 3]
    assert not cell(dataset=drive).scenario.seeded
    assert cell(dataset=drive, disturbance=[{"name": "imu_bias"}]).scenario.seeded
    assert refusal(cell(filter={"name": "gnss_only"})) == ""
    assert "does not support adaptation=mtf; supported: none" in refusal(
        cell(filter={"name": "gnss_only"}, adaptation={"name": "mtf"})
    )
    both = [{"name": "imu_bias"}, {"name": "gnss_outage"}]
    assert cell(disturbance=both).labels.disturbance == "imu_bias+gnss_outage"
    assert with_data(cell(disturbance=both), "").key != with_data(cell(disturbance=both[::-1]), "").key
    assert joined(["none", "imu_bias"]) == "imu_bias"
    assert joined(["none"]) == "none"


def test_one_line_lists_all_adaptations_that_a_filter_does_not_support():
    plan = planned(cell(filter={"name": "gnss_only"}, adaptation={"name": name}) for name in ("none", "mtf", "huber"))

    refused = "the filter gnss_only does not support adaptation=mtf, huber; supported: none."
    assert plan.refused == (f"Left out 2 combinations: {refused}",)


def test_the_cell_can_be_made_again_from_its_own_specification():
    first = cell(filter={"name": "jerk", "accel_mps2": 0.3}, noise={"jerk_mps3_per_sqrt_s": 5.0})
    again = build(first.spec, Protocol(), first.labels)

    assert with_data(first, "data").key == with_data(again, "data").key


def test_the_key_depends_on_everything_that_the_rows_depend_on(monkeypatch):
    keys = [
        with_data(one, data).key
        for one, data in [
            (cell(), "data"),
            (cell(), "other data"),
            (cell(Protocol(burn_in_s=6.0)), "data"),
            (cell(filter={"name": "baseline", "accel_mps2": 0.3}), "data"),
            (cell(adaptation={"name": "mtf"}), "data"),
            (cell(disturbance=[{"name": "imu_bias"}]), "data"),
            (cell(metrics=["position_rmse"]), "data"),
        ]
    ]
    for name, changed in (("code_digest", "an edit"), ("versions", {"numpy": "another"})):
        monkeypatch.setattr(keys_of_cells, name, lambda changed=changed: changed)
        keys.append(with_data(cell(), "data").key)

    assert len(set(keys)) == len(keys)
    assert with_data(cell(Protocol(seeds=20, first_seed=2)), "data").key == keys[-1]


@pytest.mark.parametrize(
    ("option", "values"),
    [
        ("seeds", [0]),
        ("first_seed", [-1]),
        ("burn_in_s", [-0.1, float("inf"), float("nan")]),
        ("divergence_limit_m", [0.0, -1.0, float("-inf"), float("nan")]),
    ],
)
def test_an_impossible_protocol_is_refused(option, values):
    for value in values:
        with pytest.raises(PluginError, match=f"{option} is {value}; "):
            Protocol(**{option: value})
    Protocol(burn_in_s=0.0, divergence_limit_m=float("inf"))


METRICS = {"none": [], "all": ["all"], "two": ["log_score", "coverage", "log_score"]}


def test_metrics_that_cost_time_are_computed_where_they_are_asked_for():
    names = {one: [*build({**SPEC, "metrics": asked}, Protocol()).spec["metrics"]] for one, asked in METRICS.items()}
    assert "position_rmse" in names["none"]
    assert "coverage" not in names["none"]
    assert set(names["all"]) > set(names["none"])
    assert names["two"] == ["log_score", "coverage"]
