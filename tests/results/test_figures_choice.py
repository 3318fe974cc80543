"""The choice of figures: few, all or none; the scenarios and methods that carry a finding."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.errors import PluginError
from jerkbench.results.study_figures.choice import Choice, figures_choice
from jerkbench.results.study_figures.selection import by_difference, telling_scenes

SCENES = {f"field, {disturbance}, tilt": disturbance for disturbance in ("none", "bias", "outliers", "gnss_outage")}


def rows_of(factors, seeds=20):
    """Errors of each method: its factor in each scenario, times a spread of its own."""
    rng = np.random.default_rng(5)
    rows = []
    for (filter_name, adaptation), of_scenes in factors.items():
        for disturbance, factor in zip(SCENES.values(), of_scenes, strict=True):
            label = {"dataset": "field", "disturbance": disturbance, "attitude": "tilt", "noise": "own"}
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
        "field, bias, tilt": {("baseline", "none"), ("jerk", "none")},
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

    assert order == ["field, gnss_outage, tilt", "field, none, tilt", "field, bias, tilt", "field, outliers, tilt"]
    assert list(telling_scenes(by_difference(rows, "position_rmse_m", list(SCENES)))) == order[:3]
